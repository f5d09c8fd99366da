//! Joining and leaving domains, and finding others there.

use super::*;

#[test]
fn endpoints_of_others_are_seen_with_their_user_data() {
    let claim = claim();
    let found = Arc::new(Mutex::new(Vec::new()));
    let seen = Arc::clone(&found);
    let note = move |discovery: &Discovery| seen.lock().unwrap().push(discovery.clone());
    let watching = Domain::join(&config(claim.id), &[], note).unwrap();
    let other = join(&claim);
    let user_data = b"typehash=RIHS01_00;".to_vec();
    let writer =
        other.writer("rt/x", TYPE, &Qos { user_data: user_data.clone(), ..reliable(1) }).unwrap();
    let _own = watching.writer("rt/own", TYPE, &reliable(1)).unwrap();
    let inbox = Inbox::open(&other, "rt/y", &reliable(1));
    eventually("both endpoints are found", || watching.endpoints().len() == 2);
    for endpoint in watching.endpoints() {
        let is_writer = endpoint.guid == writer.guid();
        assert_eq!(endpoint.participant, other.guid());
        assert_eq!(endpoint.side, if is_writer { Side::Writer } else { Side::Reader });
        assert_eq!(endpoint.topic, if is_writer { "rt/x" } else { "rt/y" });
        assert_eq!(endpoint.type_name, TYPE);
        assert_eq!(endpoint.terms, reliable(1).terms());
        assert_eq!(endpoint.user_data, if is_writer { &user_data[..] } else { &[] });
    }
    let guid = writer.guid();
    drop(writer);
    eventually("one is gone", || watching.endpoints().len() == 1);
    assert_eq!(watching.endpoints()[0].guid, inbox.reader.guid());
    eventually("and reported", || found.lock().unwrap().contains(&Discovery::Lost(guid)));
}

/// Our comparison of terms says what Cyclone does.
#[test]
fn endpoints_that_do_not_fit_are_not_matched() {
    let claim = claim();
    let (sender, receiver) = (join(&claim), join(&claim));
    let best_effort = Qos { reliability: Reliability::BestEffort, ..reliable(1) };
    let writer = sender.writer("rt/x", TYPE, &best_effort).unwrap();
    let deaf = Inbox::open(&receiver, "rt/x", &reliable(1));
    let hearing = Inbox::open(&receiver, "rt/x", &best_effort);
    meet(&writer, &hearing);
    eventually("both ends notice", || {
        writer.num_incompatible() == 1 && deaf.reader.num_incompatible() == 1
    });
    assert_eq!((writer.num_matched(), deaf.reader.num_matched()), (1, 0));
    assert!(best_effort.terms().conflict(&reliable(1).terms()).is_some());
}

#[test]
fn every_receiving_socket_is_bound_to_loopback() {
    let claim = claim();
    let domain = join(&claim);
    let ports = 7400 + 250 * claim.id..7400 + 250 * (claim.id + 1);
    let bound = Sockets::open().devices(|port| ports.contains(&u32::from(port)));
    assert!(!bound.is_empty());
    assert!(bound.iter().all(|device| device.as_deref() == Some("lo")), "{bound:?}");
    assert!(
        domain.receive_buffer_bytes().unwrap() >= 100_000,
        "{:?}",
        domain.receive_buffer_bytes()
    );
}

#[test]
fn a_wrong_configuration_is_refused_with_cyclones_reason() {
    let claim = claim();
    let wrong = Config { user_configuration: Some("<Nonsense/>".to_owned()), ..config(claim.id) };
    let error = Domain::join(&wrong, &[], |_| {}).err().unwrap().to_string();
    assert!(
        error.contains(&format!("domain {}", claim.id)) && error.contains("Nonsense"),
        "{error}"
    );
    // The domain is free for another attempt.
    join(&claim);
}

#[test]
fn other_tags_are_other_domains() {
    let claim = claim();
    let tagged = Config { tag: "off_1".to_owned(), ..config(claim.id) };
    let (sender, receiver) = (join_with(&tagged), join(&claim));
    let (fellow, _writer) =
        (join_with(&tagged), sender.writer("rt/x", TYPE, &reliable(1)).unwrap());
    eventually("it is found by its like", || fellow.endpoints().len() == 1);
    assert_eq!(receiver.endpoints(), []);
}

#[test]
fn names_with_nul_are_refused() {
    let claim = claim();
    let domain = join(&claim);
    let error = domain.writer("rt/\0", TYPE, &reliable(1)).err().unwrap();
    assert_eq!(error, Error::Name("rt/\0".to_owned()));
}

fn count(directory: &str) -> usize {
    std::fs::read_dir(directory).unwrap().count()
}

/// In its own process, where no other test starts or ends threads.
#[test]
fn no_thread_and_no_socket_stays_behind() {
    let ended = process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "tests::joining::comes_and_goes", "--nocapture"])
        .env("CYCLONE_COMES_AND_GOES", "1")
        .output()
        .unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stdout));
}

#[test]
fn comes_and_goes() {
    if std::env::var_os("CYCLONE_COMES_AND_GOES").is_none() {
        return;
    }
    let before = (count("/proc/self/task"), count("/proc/self/fd"));
    for _ in 0..3 {
        let claim = claim();
        let domain = join(&claim);
        let writer = domain.writer("rt/x", TYPE, &reliable(1)).unwrap();
        let inbox = Inbox::open(&domain, "rt/x", &reliable(1));
        // Endpoints keep the domain.
        drop(domain);
        writer.write(&message(10, 1), 0).unwrap();
        inbox.next();
        assert!(count("/proc/self/task") > before.0);
    }
    assert_eq!((count("/proc/self/task"), count("/proc/self/fd")), before);
}

/// The callback holds the last handle of its own reader.
#[test]
fn a_reader_may_be_dropped_by_its_own_callback() {
    let claim = claim();
    let domain = join(&claim);
    let writer = domain.writer("rt/x", TYPE, &reliable(1)).unwrap();
    let slot = Arc::new(Mutex::new(None));
    let (ended, end) = mpsc::sync_channel(1);
    let own = Arc::clone(&slot);
    let on_received = move |_| {
        drop(own.lock().unwrap().take());
        ended.send(()).unwrap();
    };
    let reader = domain.reader(["rt/x", TYPE], &reliable(1), LIMIT_BYTES, on_received).unwrap();
    *slot.lock().unwrap() = Some(reader);
    eventually("it is there", || writer.num_matched() == 1);
    writer.write(&message(10, 1), 0).unwrap();
    end.recv_timeout(PATIENCE).unwrap();
    eventually("it is gone", || writer.num_matched() == 0);
}
