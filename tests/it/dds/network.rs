//! Networks for one test alone, of Linux's network namespaces.

use std::{
    path::Path,
    process::{Command, id},
    sync::atomic::{AtomicU32, Ordering},
};

use crate::program::skip;

static NEXT: AtomicU32 = AtomicU32::new(0);

/// Where a program runs.
pub(crate) enum Place {
    /// On this machine's own network.
    Here,
    /// In a namespace, which ends with this.
    Namespace(String),
}

impl Place {
    /// A command that runs a program here.
    pub(crate) fn command(&self, program: &Path) -> Command {
        let Self::Namespace(name) = self else { return Command::new(program) };
        let mut command = Command::new("ip");
        command.args(["netns", "exec", name]).arg(program);
        command
    }

    fn namespace(end: &str) -> Result<Self, String> {
        let name = format!("profiler{}{end}{}", id(), NEXT.fetch_add(1, Ordering::Relaxed));
        run(&format!("ip netns add {name}"))?;
        Ok(Self::Namespace(name))
    }

    fn name(&self) -> &str {
        match self {
            Self::Here => "",
            Self::Namespace(name) => name,
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if let Self::Namespace(name) = self {
            drop(run(&format!("ip netns del {name}")));
        }
    }
}

fn run(line: &str) -> Result<(), String> {
    let mut words = line.split_whitespace();
    let output = Command::new(words.next().unwrap()).args(words).output();
    let output = output.map_err(|error| format!("{line}: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.success() { Ok(()) } else { Err(format!("{line}: {}", said.trim())) }
}

/// The node's place and its clients'.
pub(crate) struct Network {
    pub(crate) node: Place,
    pub(crate) client: Place,
}

impl Network {
    pub(crate) const HERE: Self = Self { node: Place::Here, client: Place::Here };

    /// Two hosts on a cable with an MTU of 1500 bytes, which loses a share of the datagrams to the client; `None` after
    /// reporting the reason if this machine does not permit it.
    pub(crate) fn cable(lost_percent: u32) -> Option<Self> {
        Self::try_cable(lost_percent)
            .map_err(|why| skip("DDS over an MTU of 1500 bytes", &why))
            .ok()
    }

    fn try_cable(lost_percent: u32) -> Result<Self, String> {
        let network = Self { node: Place::namespace("n")?, client: Place::namespace("c")? };
        let (node, client) = (network.node.name(), network.client.name());
        run(&format!(
            "ip link add wire netns {node} mtu 1500 type veth peer name wire netns {client} mtu 1500"
        ))?;
        for (name, address) in [(node, "10.77.0.1/24"), (client, "10.77.0.2/24")] {
            run(&format!("ip -n {name} link set lo up"))?;
            run(&format!("ip -n {name} link set wire up"))?;
            run(&format!("ip -n {name} addr add {address} dev wire"))?;
            run(&format!("ip -n {name} route add 239.0.0.0/8 dev wire"))?;
        }
        if lost_percent > 0 {
            let nft = format!("ip netns exec {client} nft");
            run(&format!("{nft} add table inet loss"))?;
            run(&format!(
                "{nft} add chain inet loss in {{ type filter hook input priority 0 ; }}"
            ))?;
            run(&format!(
                "{nft} add rule inet loss in iifname wire meta l4proto udp numgen random mod 100 < \
                 {lost_percent} drop"
            ))?;
        }
        Ok(network)
    }
}

/// A host whose only interface is loopback; `None` after reporting the reason if this machine does not permit it.
pub(crate) fn loopback() -> Option<Place> {
    let place = Place::namespace("l").and_then(|place| {
        let name = place.name();
        run(&format!("ip -n {name} link set lo up multicast on"))?;
        run(&format!("ip -n {name} route add 224.0.0.0/4 dev lo"))?;
        Ok(place)
    });
    place.map_err(|why| skip("DDS on loopback alone", &why)).ok()
}
