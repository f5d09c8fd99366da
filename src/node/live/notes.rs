//! Diagnostics of a camera besides its counters: the publishers of its images and positions, and their types.

use crate::{
    msg::diagnostic_msgs::DiagnosticStatus,
    node::status::Note,
    ros::transport::{Health, TopicEndpoint, Transport},
};

/// Warnings about the publishers of the image topic.
pub(super) fn on_publishers(
    transport: &dyn Transport,
    images: &TopicEndpoint,
    num_matched: usize,
) -> Vec<Note> {
    let warning = |text| Note { level: DiagnosticStatus::WARN, key: "publishers", text };
    let mut notes = Vec::new();
    let topics = transport.topics();
    let others = topics.iter().filter(|topic| {
        topic.name == images.name && topic.type_name != images.kind.name && topic.num_publishers > 0
    });
    for other in others {
        notes.push(warning(format!(
            "{} is published as {}, but {} is expected: set image_transport, or remap image_raw",
            images.name, other.type_name, images.kind.name
        )));
    }
    if num_matched > 1 {
        notes.push(warning(format!(
            "{num_matched} publishers on {}: frames of several cameras are mixed; remap all but one",
            images.name
        )));
    }
    if num_matched == 0 && notes.is_empty() {
        notes.push(warning(format!("{} has no publisher on {}", images.name, transport.name())));
    }
    notes
}

/// The state of the middleware process. Replacing it is a warning until the next report.
pub(super) fn on_health(health: &Health, num_restarts_before: u64) -> Vec<Note> {
    let mut notes = Vec::new();
    let note = |level, key, text| Note { level, key, text };
    if health.num_restarts > num_restarts_before {
        let reason = health.last_failure.as_deref().unwrap_or("unknown");
        let text = format!("the middleware process was replaced: {reason}");
        notes.push(note(DiagnosticStatus::WARN, "middleware", text));
    }
    if health.resident_bytes > 0 {
        let restarts = health.num_restarts.to_string();
        notes.push(note(DiagnosticStatus::OK, "middleware restarts", restarts));
        let megabytes = (health.resident_bytes >> 20).to_string();
        notes.push(note(DiagnosticStatus::OK, "middleware memory [MB]", megabytes));
    }
    if health.num_overrun > 0 {
        let overrun = health.num_overrun.to_string();
        notes.push(note(DiagnosticStatus::OK, "messages dropped before the node", overrun));
    }
    notes
}

/// Error about a thread that panicked; the node ends.
pub(super) fn on_panic(name: &str) -> Note {
    let text = format!("{name} ended by a programming error: the node ends");
    Note { level: DiagnosticStatus::ERROR, key: "threads", text }
}

/// Warnings about topics of the axis without a publisher.
pub(super) fn on_positions(transport: &dyn Transport, topics: &[&TopicEndpoint]) -> Vec<Note> {
    let note = |topic: &&TopicEndpoint| Note {
        level: DiagnosticStatus::WARN,
        key: "positions",
        text: format!(
            "{} ({}) has no publisher on {}: frames have no position",
            topic.name,
            topic.kind.name,
            transport.name()
        ),
    };
    topics.iter().map(note).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        msg::{
            qos::QosProfile,
            schema::{Message, MessageType},
            sensor_msgs::{CompressedImage, Image},
        },
        ros::loopback::Loopback,
    };

    fn endpoint(kind: &'static MessageType) -> TopicEndpoint {
        TopicEndpoint { name: "/image_raw".into(), kind, qos: QosProfile::best_effort(5) }
    }

    #[test]
    fn a_replaced_middleware_process_is_reported_once_and_counted() {
        let health = Health {
            num_restarts: 2,
            last_failure: Some("it ended".to_owned()),
            num_overrun: 3,
            resident_bytes: 40 << 20,
        };
        let levels = |notes: &[Note]| notes.iter().filter(|note| note.level > 0).count();
        let notes = on_health(&health, 1);
        assert_eq!(notes[0].text, "the middleware process was replaced: it ended");
        assert_eq!(levels(&notes), 1);
        let texts: Vec<_> = notes[1..].iter().map(|note| note.text.as_str()).collect();
        assert_eq!(texts, ["2", "40", "3"]);
        assert_eq!(levels(&on_health(&health, 2)), 0);
        assert!(on_health(&Health::default(), 0).is_empty(), "no such process");
    }

    #[test]
    fn causes_of_missing_images_are_reported() {
        let network = Loopback::default();
        let images = endpoint(Image::TYPE);
        let text = |num| on_publishers(&network, &images, num).pop().map(|note| note.text);
        assert_eq!(text(0).as_deref(), Some("/image_raw has no publisher on loopback"));
        assert_eq!(text(1), None);
        assert!(text(2).is_some_and(|text| text.starts_with("2 publishers on /image_raw")));
        let _wrong = network.advertise(&endpoint(CompressedImage::TYPE)).unwrap();
        let note = text(0).unwrap();
        assert!(note.contains("published as sensor_msgs/msg/CompressedImage"), "{note}");
    }
}
