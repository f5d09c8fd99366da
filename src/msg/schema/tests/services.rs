use std::collections::BTreeMap;

use hiroz_schema::{
    FieldDescription, FieldTypeDescription, TypeDescription, TypeDescriptionMsg, calculate_hash,
};

use super::{description, referenced};
use crate::msg::{
    builtin_interfaces::Time,
    laser_profiler_msgs::{self, StartScanRequest, StartScanResponse},
    lifecycle_msgs::{
        self, ChangeStateRequest, ChangeStateResponse, GetAvailableStatesRequest,
        GetAvailableStatesResponse, GetAvailableTransitionsRequest,
        GetAvailableTransitionsResponse, GetStateRequest, GetStateResponse,
    },
    schema::{Message, MessageType, ServiceType},
    std_srvs::{self, SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse},
};

const NESTED: u8 = 1;
/// A sequence of at most one message.
const OPTIONAL: u8 = 97;

/// `service_msgs/msg/ServiceEventInfo`, which no message of ours holds. Its `char[16]` is `uint8[16]` in IDL.
const EVENT_INFO: MessageType = MessageType {
    name: "service_msgs/msg/ServiceEventInfo",
    text: "uint8 event_type\nbuiltin_interfaces/Time stamp\nchar[16] client_gid\nint64 sequence_number\n",
    dependencies: &[Time::TYPE],
    hash: "RIHS01_41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45",
};

fn field(name: &str, type_id: u8, message: &str) -> FieldDescription {
    FieldDescription {
        name: name.to_owned(),
        field_type: FieldTypeDescription {
            type_id,
            capacity: u64::from(type_id == OPTIONAL),
            string_capacity: 0,
            nested_type_name: message.to_owned(),
        },
        default_value: String::new(),
    }
}

/// The service as rosidl describes it: request, response, and an event that holds both.
fn check_service<Request: Message, Response: Message>(service: &ServiceType) {
    let [request, response, event] =
        ["Request", "Response", "Event"].map(|part| format!("{}_{part}", service.name));
    assert_eq!((Request::TYPE.name, Response::TYPE.name), (&request[..], &response[..]));
    assert_eq!(format!("{}---\n{}", Request::TYPE.text, Response::TYPE.text), service.text);

    let mut found = BTreeMap::new();
    for message in [Request::TYPE, Response::TYPE, &EVENT_INFO] {
        found.insert(message.name, description(message));
        referenced(message, &mut found);
    }
    let fields = vec![
        field("info", NESTED, EVENT_INFO.name),
        field("request", OPTIONAL, &request),
        field("response", OPTIONAL, &response),
    ];
    found.insert(&event, TypeDescription { type_name: event.clone(), fields });
    let fields = vec![
        field("request_message", NESTED, &request),
        field("response_message", NESTED, &response),
        field("event_message", NESTED, &event),
    ];
    let whole = TypeDescriptionMsg {
        type_description: TypeDescription { type_name: service.name.to_owned(), fields },
        referenced_type_descriptions: found.into_values().collect(),
    };
    assert_eq!(calculate_hash(&whole).to_rihs_string(), service.hash, "{}", service.name);
}

#[test]
fn every_service_hash_is_that_of_its_text() {
    check_service::<TriggerRequest, TriggerResponse<'_>>(&std_srvs::TRIGGER);
    check_service::<SetBoolRequest, SetBoolResponse<'_>>(&std_srvs::SET_BOOL);
    check_service::<StartScanRequest<'_>, StartScanResponse<'_>>(&laser_profiler_msgs::START_SCAN);
    check_service::<ChangeStateRequest<'_>, ChangeStateResponse>(&lifecycle_msgs::CHANGE_STATE);
    check_service::<GetStateRequest, GetStateResponse<'_>>(&lifecycle_msgs::GET_STATE);
    check_service::<GetAvailableStatesRequest, GetAvailableStatesResponse<'_>>(
        &lifecycle_msgs::GET_AVAILABLE_STATES,
    );
    check_service::<GetAvailableTransitionsRequest, GetAvailableTransitionsResponse<'_>>(
        &lifecycle_msgs::GET_AVAILABLE_TRANSITIONS,
    );
}

#[test]
fn service_hashes_are_the_published_ones() {
    for (service, hash) in [
        (
            &std_srvs::TRIGGER,
            "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
        ),
        (
            &std_srvs::SET_BOOL,
            "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
        ),
    ] {
        assert_eq!(service.hash, format!("RIHS01_{hash}"), "{}", service.name);
    }
}
