//! Tests a live node with viewers.

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::{
    driver::{Picture, encoded},
    rig::{Rig, Setup, text},
    stream::counts,
    viewer::{Seen, Viewer},
};
use crate::{
    msg::{
        cdr,
        laser_profiler_msgs::Centerline,
        sensor_msgs::Image,
        std_srvs::{SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse},
    },
    node::view::{Address, Entrance, Images, Token, ViewRequest, live::LiveView},
    ros::names::NodeNames,
};

const LINE: &str = "/laser_profiler/centerline";
const PREVIEW: &str = "/laser_profiler/preview";
const OVERLAY: &str = "/laser_profiler/preview_annotations";
/// More frames than the system's buffers and the server's queue hold for a viewer that does not read.
const MANY_FRAMES: usize = 40;

fn viewed(images: Images) -> (Rig, Arc<LiveView>) {
    viewed_with(images, None)
}

fn viewed_with(images: Images, token: Option<Token>) -> (Rig, Arc<LiveView>) {
    let mut setup = Setup::new();
    let names = NodeNames::new("laser_profiler", &[]).unwrap();
    let address = Address::parse("0").unwrap();
    let entrance = Entrance::new(address, Vec::new(), token, None).unwrap();
    let request = ViewRequest { entrance, images };
    let view = Arc::new(LiveView::of(&names, &setup.values, &request).unwrap());
    let through = Arc::clone(&view);
    setup.through = Box::new(move |network| through.through(network));
    let rig = setup.start().unwrap();
    view.set_parameters_of(rig.parameters.clone());
    (rig, view)
}

/// Waits until earlier requests are processed: the server answers in order.
fn settle(viewer: &mut Viewer) {
    viewer.send(&json!({"op": "getParameters", "parameterNames": ["autostart"], "id": "settle"}));
    viewer.wait(|_, seen| {
        matches!(seen, Seen::Text(text) if text["op"] == "parameterValues").then_some(())
    });
}

#[test]
fn viewers_receive_the_published_bytes() {
    let (rig, view) = viewed(Images::Preview);
    let mut viewer = Viewer::connect(view.address());
    viewer.subscribe(&[LINE, PREVIEW, OVERLAY]);
    settle(&mut viewer);
    let mut camera = rig.camera();
    camera.picture = Picture { width: 1300, ..Picture::default() };
    camera.shoot();
    let published = rig.results("centerline", 1);
    let (mut line, mut picture, mut overlay) = (None, None, None);
    while line.is_none() || picture.is_none() || overlay.is_none() {
        match viewer.next() {
            Seen::Message(topic, data) if topic == LINE => line = Some(data),
            Seen::Message(topic, data) if topic == PREVIEW => picture = Some(data),
            Seen::Message(topic, data) if topic == OVERLAY => overlay = Some(data),
            _ => {}
        }
    }
    assert_eq!(line.unwrap(), published[0].data);
    let picture = picture.unwrap();
    let picture: Image<'_> = cdr::decode(&picture).unwrap();
    assert_eq!((picture.width, picture.height, &*picture.encoding), (434, 11, "mono8"));
    // The brightest row, 10, is the second of its three.
    assert_eq!(picture.data.iter().position(|&level| level == 200), Some(3 * 434));
    drop(rig);
}

#[test]
fn viewers_that_do_not_read_cause_no_dropped_frames() {
    let (rig, view) = viewed(Images::Full);
    let mut viewers: Vec<_> = (0..5).map(|_| Viewer::connect(view.address())).collect();
    for viewer in &mut viewers {
        viewer.subscribe(&[
            "/image_raw",
            LINE,
            "/laser_profiler/points",
            "/laser_profiler/annotations",
        ]);
        settle(viewer);
    }
    let mut camera = rig.camera();
    camera.picture = Picture { width: 2000, height: 1000, row: 500, encoding: "mono8" };
    for number in 1..=MANY_FRAMES {
        camera.shoot();
        rig.results("centerline", number);
    }
    assert!(view.num_sent() > MANY_FRAMES as u64, "the viewers were sent their topics");
    let counts = counts(rig.end());
    assert_eq!((counts.received, counts.processed), (MANY_FRAMES as u64, MANY_FRAMES as u64));
    drop(viewers);
}

#[test]
fn nothing_is_encoded_without_a_subscriber() {
    let (rig, view) = viewed(Images::Preview);
    // Connected, but without a subscription.
    let mut viewer = Viewer::connect(view.address());
    settle(&mut viewer);
    rig.camera().shoot_times(3);
    rig.results("centerline", 3);
    assert_eq!(view.num_sent(), 0);
    drop(rig);
}

#[test]
fn parameters_and_services_are_those_of_the_node() {
    let (rig, view) = viewed(Images::None);
    let mut viewer = Viewer::connect(view.address());
    let method = "extraction.method";
    viewer.send(&json!({"op": "subscribeParameterUpdates", "parameterNames": [method]}));
    settle(&mut viewer);
    let set = |name: &str, value: Json| json!({"op": "setParameters", "parameters": [{"name": name, "value": value}], "id": "set"});
    viewer.send(&set(method, json!("gray_gravity")));
    let effective_method = |viewer: &mut Viewer| {
        viewer.wait(|_, seen| match seen {
            Seen::Text(text) if text["op"] == "parameterValues" => {
                let found =
                    text["parameters"].as_array()?.iter().find(|it| it["name"] == method)?;
                Some(found["value"].as_str()?.to_owned())
            }
            _ => None,
        })
    };
    assert_eq!(effective_method(&mut viewer), "gray_gravity");
    let mut camera = rig.camera();
    camera.shoot();
    let lines = rig.results("centerline", 1);
    let line: Centerline<'_> = lines[0].decode();
    assert!(line.method.contains("gray_gravity"), "{}", line.method);
    // Viewers see parameters set over ROS.
    rig.set(method, &text("gaussian_fit")).unwrap();
    while effective_method(&mut viewer) != "gaussian_fit" {}
    viewer.send(&set("autostart", json!(false)));
    let refused = viewer.wait(|_, seen| match seen {
        Seen::Text(text) if text["op"] == "status" => Some(text["message"].to_string()),
        _ => None,
    });
    assert!(refused.contains("read-only"), "{refused}");
    let answer = viewer.call("/laser_profiler/start_scan", &encoded(&TriggerRequest::default()));
    let answer: TriggerResponse<'_> = cdr::decode(&answer).unwrap();
    assert!(answer.success && answer.message.contains("begins with the next frame"));
    // Some viewers send an empty message without the padding byte of ROS.
    let answer = viewer.call("/laser_profiler/stop_scan", &[0, 1, 0, 0]);
    assert!(cdr::decode::<TriggerResponse<'_>>(&answer).unwrap().success);
    let answer = viewer.call("/laser_profiler/record", &encoded(&SetBoolRequest { data: false }));
    let answer: SetBoolResponse<'_> = cdr::decode(&answer).unwrap();
    assert_eq!(answer.message, "nothing was being recorded");
    let mut names: Vec<_> = viewer.services.keys().map(String::as_str).collect();
    names.sort_unstable();
    let expected = ["record", "reset", "snapshot", "start_scan", "stop_scan"];
    assert_eq!(names, expected.map(|name| format!("/laser_profiler/{name}")));
    drop(rig);
}

#[test]
fn the_graph_is_sent_on_request() {
    let (rig, view) = viewed(Images::None);
    let mut viewer = Viewer::connect(view.address());
    viewer.send(&json!({"op": "subscribeConnectionGraph"}));
    let is_told = |topics: &Json| {
        let mut names = topics.as_array().into_iter().flatten();
        names.any(|topic| topic["name"] == LINE)
    };
    viewer.wait(|_, seen| match seen {
        Seen::Text(text) if text["op"] == "connectionGraphUpdate" => {
            is_told(&text["publishedTopics"]).then_some(())
        }
        _ => None,
    });
    drop(rig);
}

#[test]
fn a_viewer_without_the_token_changes_nothing() {
    let token = Token::new("o-p.e_n.sesame").unwrap();
    let (rig, view) = viewed_with(Images::None, Some(token));
    let mut viewer = Viewer::connect(view.address());
    let refusal = |viewer: &mut Viewer, kind: &str| {
        viewer.wait(|_, seen| match seen {
            Seen::Text(text) if text["op"] == kind => Some(text["message"].to_string()),
            _ => None,
        })
    };
    let name = "extraction.method";
    viewer.send(&json!({"op": "setParameters", "parameters": [{"name": name, "value": "gray_gravity"}], "id": "set"}));
    assert!(refusal(&mut viewer, "status").contains("may look only"));
    let value = rig.parameters.read(|values| values.get(name).map(|it| it.value().clone()));
    assert_ne!(value, Some(text("gray_gravity")));
    viewer.start_call("/laser_profiler/record", &encoded(&SetBoolRequest { data: true }));
    assert!(refusal(&mut viewer, "serviceCallFailure").contains("may look only"));
    assert_eq!(rig.stop_recording().1, "nothing was being recorded");
    drop(rig);
}
