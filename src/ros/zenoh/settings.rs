//! Settings of the Zenoh session, from the environment variables of `rmw_zenoh_cpp`.

use std::{fmt::Display, path::PathBuf, str::FromStr};

use crate::ros::transport::TransportError;

/// Settings of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ZenohSettings {
    /// `ROS_DOMAIN_ID`.
    pub(crate) domain_id: u32,
    /// Role of the session in its network.
    pub(crate) role: Role,
    /// File with a Zenoh configuration that replaces ROS's own, JSON5 or YAML: `ZENOH_SESSION_CONFIG_URI`, for a router
    /// `ZENOH_ROUTER_CONFIG_URI`.
    pub(crate) config_file: Option<PathBuf>,
    /// Values that override the configuration, in order.
    pub(crate) overrides: Vec<Override>,
    /// `ZENOH_ROUTER_CHECK_ATTEMPTS`.
    pub router_check: RouterCheck,
}

/// Role of a session in its network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Joins a router.
    Node,
    /// Is the router: `--router`.
    Router,
}

/// One value of Zenoh's configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Override {
    /// Variable that sets it, for errors.
    pub(crate) variable: &'static str,
    /// Path of the value, such as `connect/endpoints`.
    pub(crate) key: String,
    /// Value, JSON5.
    pub(crate) value: String,
}

/// Waiting for the router when a session is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RouterCheck {
    /// No check.
    Skip,
    /// This number of checks, a second apart; then the session continues without a router.
    Attempts(u64),
    /// Wait until a router is found.
    Forever,
}

const OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";

impl ZenohSettings {
    /// Reads the environment through `variable`. An empty variable counts as unset.
    ///
    /// # Errors
    /// An invalid variable.
    pub fn from_environment(
        variable: &dyn Fn(&str) -> Option<String>,
        role: Role,
    ) -> Result<Self, TransportError> {
        let variable = |name: &str| variable(name).filter(|value| !value.trim().is_empty());
        let config_variable = config_variable(role);
        if role == Role::Router && variable(config_variable).is_none() {
            refuse_session_file(variable(self::config_variable(Role::Node)))?;
        }
        let mut overrides = Vec::new();
        let pool = "transport/shared_memory/transport_optimization/";
        for (name, key) in [
            ("ZENOH_SHM_ALLOC_SIZE", "pool_size"),
            ("ZENOH_SHM_MESSAGE_SIZE_THRESHOLD", "message_size_threshold"),
        ] {
            if let Some(bytes) = variable(name) {
                let value = number::<u64>(name, &bytes, "a number of bytes")?.to_string();
                overrides.push(Override { variable: name, key: format!("{pool}{key}"), value });
            }
        }
        overrides.extend(parse_overrides(&variable(OVERRIDE).unwrap_or_default())?);
        let domain = variable("ROS_DOMAIN_ID");
        let domain = domain.map(|text| number("ROS_DOMAIN_ID", &text, "a number such as 0 or 42"));
        let attempts = variable("ZENOH_ROUTER_CHECK_ATTEMPTS");
        Ok(Self {
            domain_id: domain.transpose()?.unwrap_or(0),
            role,
            config_file: variable(config_variable).map(PathBuf::from),
            overrides,
            router_check: attempts
                .map_or(Ok(RouterCheck::Attempts(1)), |text| attempts_of(&text))?,
        })
    }
}

/// Refuses a router whose user configured sessions only, perhaps with TLS: the defaults of ROS listen to every address,
/// unencrypted.
fn refuse_session_file(session_file: Option<String>) -> Result<(), TransportError> {
    let Some(file) = session_file else { return Ok(()) };
    Err(wrong(
        config_variable(Role::Node),
        format!(
            "{file} is for sessions; a router reads neither it nor its TLS keys: set {} to a router's \
             configuration (mode, listen/endpoints and, for TLS, transport/link/tls), unset this one, or omit \
             --router",
            config_variable(Role::Router)
        ),
    ))
}

/// Returns the variable that names the configuration file.
pub(super) const fn config_variable(role: Role) -> &'static str {
    match role {
        Role::Node => "ZENOH_SESSION_CONFIG_URI",
        Role::Router => "ZENOH_ROUTER_CONFIG_URI",
    }
}

fn attempts_of(text: &str) -> Result<RouterCheck, TransportError> {
    let right = "a number of checks for a router (0: unlimited, negative: none)";
    Ok(match number::<i64>("ZENOH_ROUTER_CHECK_ATTEMPTS", text, right)? {
        0 => RouterCheck::Forever,
        ..0 => RouterCheck::Skip,
        attempts => RouterCheck::Attempts(attempts.unsigned_abs()),
    })
}

fn number<T: FromStr>(setting: &str, text: &str, right: &str) -> Result<T, TransportError> {
    let number = text.trim().parse().ok();
    number.ok_or_else(|| wrong(setting, format!("{text:?} is not {right}")))
}

fn wrong(setting: &str, reason: impl Display) -> TransportError {
    TransportError::Setting { setting: setting.to_owned(), reason: reason.to_string() }
}

/// Parses `key=value;key=value`. A semicolon within quotation marks belongs to its value.
fn parse_overrides(text: &str) -> Result<Vec<Override>, TransportError> {
    let mut is_quoted = false;
    let pairs = text.split(|letter| {
        is_quoted ^= letter == '"';
        letter == ';' && !is_quoted
    });
    let pairs = pairs.map(str::trim).filter(|pair| !pair.is_empty());
    let parse = |pair: &str| match pair.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() && !value.trim().is_empty() => Ok(Override {
            variable: OVERRIDE,
            key: key.trim().to_owned(),
            value: value.trim().to_owned(),
        }),
        _ => Err(wrong(
            OVERRIDE,
            format!(
                "{pair:?} is not key=value, such as connect/endpoints=[\"tcp/192.168.1.1:7447\"]"
            ),
        )),
    };
    pairs.map(parse).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(variables: &[(&str, &str)]) -> Result<ZenohSettings, String> {
        let variable = |name: &str| {
            let found = variables.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| (*value).to_owned())
        };
        ZenohSettings::from_environment(&variable, Role::Node).map_err(|error| error.to_string())
    }

    #[test]
    fn an_empty_environment_gives_the_defaults_of_ros() {
        let plain = ZenohSettings {
            domain_id: 0,
            role: Role::Node,
            config_file: None,
            overrides: Vec::new(),
            router_check: RouterCheck::Attempts(1),
        };
        assert_eq!(settings(&[]).unwrap(), plain);
        assert_eq!(settings(&[("ROS_DOMAIN_ID", ""), (OVERRIDE, " ")]).unwrap(), plain);
    }

    #[test]
    fn each_role_has_its_configuration_file() {
        let variable = |name: &str| Some(name.to_owned()).filter(|name| name.ends_with("_URI"));
        for (role, name) in
            [(Role::Node, "ZENOH_SESSION_CONFIG_URI"), (Role::Router, "ZENOH_ROUTER_CONFIG_URI")]
        {
            let settings = ZenohSettings::from_environment(&variable, role).unwrap();
            assert_eq!(settings.config_file, Some(PathBuf::from(name)));
        }
    }

    #[test]
    fn a_router_does_not_ignore_the_configuration_of_sessions() {
        let open = |names: &[&str], role| {
            let variable = |name: &str| names.contains(&name).then(|| "tls.json5".to_owned());
            ZenohSettings::from_environment(&variable, role).map_err(|error| error.to_string())
        };
        let (session, router) = ("ZENOH_SESSION_CONFIG_URI", "ZENOH_ROUTER_CONFIG_URI");
        let refused = open(&[session], Role::Router).unwrap_err();
        for part in [session, "tls.json5", router, "TLS keys", "omit --router"] {
            assert!(refused.contains(part), "{refused}");
        }
        assert!(open(&[session, router], Role::Router).is_ok());
        assert!(open(&[], Role::Router).is_ok());
        assert!(open(&[session], Role::Node).is_ok());
    }

    #[test]
    fn router_checks_are_those_of_rmw() {
        let check = |text| settings(&[("ZENOH_ROUTER_CHECK_ATTEMPTS", text)]).unwrap().router_check;
        assert_eq!(check("0"), RouterCheck::Forever);
        assert_eq!(check("-1"), RouterCheck::Skip);
        assert_eq!(check("5"), RouterCheck::Attempts(5));
    }

    #[test]
    fn overrides_keep_their_order_and_their_semicolons() {
        let text = r#"mode="client"; connect/endpoints=["tcp/a:1#iface=x;prio=1"];;"#;
        let overrides = settings(&[(OVERRIDE, text), ("ZENOH_SHM_ALLOC_SIZE", "100")]).unwrap();
        let pairs: Vec<_> = overrides
            .overrides
            .iter()
            .map(|pair| (pair.key.as_str(), pair.value.as_str()))
            .collect();
        let expected = [
            ("transport/shared_memory/transport_optimization/pool_size", "100"),
            ("mode", "\"client\""),
            ("connect/endpoints", r#"["tcp/a:1#iface=x;prio=1"]"#),
        ];
        assert_eq!(pairs, expected);
    }

    #[test]
    fn errors_name_the_variable() {
        for (name, value) in [
            ("ROS_DOMAIN_ID", "-1"),
            ("ROS_DOMAIN_ID", "a"),
            ("ZENOH_ROUTER_CHECK_ATTEMPTS", "often"),
            ("ZENOH_SHM_ALLOC_SIZE", "48M"),
            (OVERRIDE, "mode"),
            (OVERRIDE, "=1"),
            (OVERRIDE, "mode="),
        ] {
            let message = settings(&[(name, value)]).unwrap_err();
            assert!(message.starts_with(&format!("{name}: ")), "{message}");
        }
    }
}
