//! Delivery of messages, also beside slow readers.

use super::*;

#[test]
fn messages_of_all_sizes_arrive_in_order_with_their_metadata() {
    let claim = claim();
    let (sender, receiver) = (join(&claim), join(&claim));
    let writer = sender.writer("rt/x", TYPE, &reliable(100)).unwrap();
    let inbox = Inbox::open(&receiver, "rt/x", &reliable(100));
    meet(&writer, &inbox);
    // Around the sizes of a fragment and a datagram, and as large as images.
    let sizes = [4, 5, 6, 7, 8, 1343, 1344, 1345, 1346, 14_719, 14_721, 65_537, 1 << 20, 5_308_468];
    for (number, bytes) in sizes.into_iter().enumerate() {
        writer.write(&message(bytes, number), 7_000_000_000 + number as i64).unwrap();
    }
    for (number, bytes) in sizes.into_iter().enumerate() {
        let arrived = inbox.next();
        assert!(
            (bytes..=bytes.next_multiple_of(4)).contains(&arrived.bytes.len()),
            "{bytes} bytes"
        );
        assert!(
            arrived.bytes.starts_with(&message(bytes, number)),
            "{bytes} bytes are what was sent"
        );
        assert_eq!(arrived.sequence, Some(number as i64 + 1), "{bytes} bytes");
        assert_eq!(arrived.writer, Some(writer.guid()));
        assert!((arrived.source_time_ns - 7_000_000_000 - number as i64).abs() <= 1);
    }
}

#[test]
fn messages_within_a_participant_arrive_too() {
    let claim = claim();
    let domain = join(&claim);
    let writer = domain.writer("rt/x", TYPE, &reliable(10)).unwrap();
    let inboxes = [0, 1].map(|_| Inbox::open(&domain, "rt/x", &reliable(10)));
    eventually("both are matched", || writer.num_matched() == 2);
    writer.write(&message(1001, 5), 3).unwrap();
    for inbox in &inboxes {
        assert_eq!(inbox.next().bytes, *message(1001, 5));
    }
}

#[test]
fn late_readers_receive_exactly_the_depth() {
    for depth in [1, 3] {
        let claim = claim();
        let (sender, receiver) = (join(&claim), join(&claim));
        let latched = Qos { durability: Durability::TransientLocal, ..reliable(depth) };
        let writer = sender.writer("rt/x", TYPE, &latched).unwrap();
        for number in 1..=9 {
            writer.write(&message(100, number), 0).unwrap();
        }
        // Its own history is longer.
        let late = Qos { durability: Durability::TransientLocal, ..reliable(50) };
        let inbox = Inbox::open(&receiver, "rt/x", &late);
        meet(&writer, &inbox);
        for number in 10 - depth as usize..=9 {
            assert_eq!(inbox.next().bytes, *message(100, number), "depth {depth}");
        }
        writer.write(&message(100, 10), 0).unwrap();
        assert_eq!(inbox.next().bytes, *message(100, 10), "nothing else was sent before");
    }
}

#[test]
fn a_reader_that_takes_nothing_delays_neither_writer_nor_other_readers() {
    let claim = claim();
    let (sender, slow, quick) = (join(&claim), join(&claim), join(&claim));
    let writer = sender.writer("rt/x", TYPE, &reliable(10)).unwrap();
    let (release, held) = mpsc::sync_channel::<()>(0);
    let wait = move |_| held.recv().unwrap_or_default();
    let stuck = slow.reader(["rt/x", TYPE], &reliable(1), LIMIT_BYTES, wait).unwrap();
    let inbox = Inbox::open(&quick, "rt/x", &reliable(10));
    eventually("both are there", || writer.num_matched() == 2);
    meet(&writer, &inbox);
    for number in 0..30 {
        writer.write(&message(1_000_000, number), 0).unwrap();
        assert_eq!(inbox.next().sequence, Some(number as i64 + 1));
    }
    drop(release);
    drop(stuck);
}

/// A writer that keeps all messages does wait, but no longer than it should.
#[test]
fn a_writer_that_keeps_all_waits_within_its_bound() {
    let claim = claim();
    let (sender, slow) = (join(&claim), join(&claim));
    let all = Qos { history: History::KeepAll(4), ..reliable(1) };
    let writer = sender.writer("rt/x", TYPE, &all).unwrap();
    let (release, held) = mpsc::sync_channel::<()>(0);
    let wait = move |_| held.recv().unwrap_or_default();
    let stuck = slow.reader(["rt/x", TYPE], &all, LIMIT_BYTES, wait).unwrap();
    eventually("it is there", || writer.num_matched() == 1 && stuck.num_matched() == 1);
    let started = Instant::now();
    let refused = (0..1000).find_map(|number| writer.write(&message(1000, number), 0).err());
    assert_eq!(refused, Some(Error::TooSlow));
    assert!(started.elapsed() < Duration::from_secs(20), "{:?}", started.elapsed());
    drop(release);
}

#[test]
fn large_messages_are_refused_where_they_are_too_large() {
    let claim = claim();
    let small = Config { max_sample_bytes: 50_000, ..config(claim.id) };
    let (sender, receiver) = (join(&claim), join_with(&small));
    let writer = sender.writer("rt/x", TYPE, &reliable(10)).unwrap();
    let inbox = Inbox::open_up_to(&receiver, "rt/x", &reliable(10), 10_000);
    meet(&writer, &inbox);
    // Above the domain's limit: it never arrives. Above the reader's: its length does.
    for (number, bytes) in [60_000, 20_000, 100].into_iter().enumerate() {
        writer.write(&message(bytes, number), 0).unwrap();
    }
    let arrived = inbox.received.recv_timeout(PATIENCE).unwrap();
    assert_eq!(arrived, Received::TooLarge { bytes: 20_000 });
    assert_eq!(inbox.next().bytes, *message(100, 2));
    let own = receiver.writer("rt/y", TYPE, &reliable(1)).unwrap();
    let (bytes, limit_bytes) = (60_000, 50_000);
    assert_eq!(own.write(&message(bytes, 0), 0), Err(Error::TooLarge { bytes, limit_bytes }));
    assert_eq!(own.write(&Arc::from([0, 1, 0]), 0), Err(Error::NoHeader(3)));
}

/// Lost datagrams leave gaps in the numbers of a best-effort reader, so that they can be counted.
#[test]
fn sequence_numbers_show_what_is_lost() {
    let claim = claim();
    let lossy = "<CycloneDDS><Domain><Internal><Test><XmitLossiness>100</XmitLossiness></Test></Internal></Domain>\
                 </CycloneDDS>";
    let lossy = Config { user_configuration: Some(lossy.to_owned()), ..config(claim.id) };
    let (sender, receiver) = (join_with(&lossy), join(&claim));
    let best_effort = Qos { reliability: Reliability::BestEffort, ..reliable(1000) };
    let writer = sender.writer("rt/x", TYPE, &best_effort).unwrap();
    let inbox = Inbox::open(&receiver, "rt/x", &best_effort);
    meet(&writer, &inbox);
    let mut numbers = Vec::new();
    let mut sent = 0;
    while numbers.len() < 50 {
        sent += 1;
        let payload = message(5000, sent);
        writer.write(&payload, 0).unwrap();
        if let Ok(Received::Message(arrived)) =
            inbox.received.recv_timeout(Duration::from_millis(100))
        {
            let number = arrived.sequence.unwrap();
            assert_eq!(
                arrived.bytes,
                *message(5000, number as usize),
                "the number is the message's"
            );
            numbers.push(number);
        }
    }
    assert!(numbers.is_sorted() && *numbers.last().unwrap() > 50, "{numbers:?}");
}
