use std::collections::BTreeMap;

use hiroz_schema::{
    FieldDescription, FieldTypeDescription, TypeDescription, TypeDescriptionMsg, calculate_hash,
};

use super::{description, referenced};
use crate::msg::{
    action_msgs::{self, CancelGoalRequest, CancelGoalResponse},
    builtin_interfaces::Time,
    laser_profiler_msgs::{self, StartScanRequest, StartScanResponse, scan},
    lifecycle_msgs::{
        self, ChangeStateRequest, ChangeStateResponse, GetAvailableStatesRequest,
        GetAvailableStatesResponse, GetAvailableTransitionsRequest,
        GetAvailableTransitionsResponse, GetStateRequest, GetStateResponse,
    },
    rcl_interfaces,
    schema::{Message, MessageType, ServiceType},
    std_srvs::{self, SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse},
};

const NESTED: u8 = 1;
/// A sequence of at most one message.
const OPTIONAL: u8 = 97;

/// `service_msgs/msg/ServiceEventInfo`, which none of our messages contains. Its `char[16]` is `uint8[16]` in IDL.
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

/// Checks the hash of a service as rosidl describes it: request, response, and an event with both.
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
    let mut inside: Vec<_> = found.into_values().collect();
    inside.push(TypeDescription { type_name: event.clone(), fields });
    inside.sort_by(|left, right| left.type_name.cmp(&right.type_name));
    let fields = vec![
        field("request_message", NESTED, &request),
        field("response_message", NESTED, &response),
        field("event_message", NESTED, &event),
    ];
    let whole = TypeDescriptionMsg {
        type_description: TypeDescription { type_name: service.name.to_owned(), fields },
        referenced_type_descriptions: inside,
    };
    assert_eq!(calculate_hash(&whole).to_rihs_string(), service.hash, "{}", service.name);
}

#[test]
fn every_service_hash_is_that_of_its_text() {
    check_service::<TriggerRequest, TriggerResponse<'_>>(&std_srvs::TRIGGER);
    check_service::<SetBoolRequest, SetBoolResponse<'_>>(&std_srvs::SET_BOOL);
    check_service::<StartScanRequest<'_>, StartScanResponse<'_>>(&laser_profiler_msgs::START_SCAN);
    check_service::<scan::SendGoalRequest<'_>, scan::SendGoalResponse>(&scan::SEND_GOAL);
    check_service::<scan::GetResultRequest, scan::GetResultResponse<'_>>(&scan::GET_RESULT);
    check_service::<CancelGoalRequest, CancelGoalResponse>(&action_msgs::CANCEL_GOAL);
    check_service::<ChangeStateRequest<'_>, ChangeStateResponse>(&lifecycle_msgs::CHANGE_STATE);
    check_service::<GetStateRequest, GetStateResponse<'_>>(&lifecycle_msgs::GET_STATE);
    check_service::<GetAvailableStatesRequest, GetAvailableStatesResponse<'_>>(
        &lifecycle_msgs::GET_AVAILABLE_STATES,
    );
    check_service::<GetAvailableTransitionsRequest, GetAvailableTransitionsResponse<'_>>(
        &lifecycle_msgs::GET_AVAILABLE_TRANSITIONS,
    );
    check_service::<
        rcl_interfaces::DescribeParametersRequest<'_>,
        rcl_interfaces::DescribeParametersResponse<'_>,
    >(&rcl_interfaces::DESCRIBE_PARAMETERS);
    check_service::<
        rcl_interfaces::GetParametersRequest<'_>,
        rcl_interfaces::GetParametersResponse<'_>,
    >(&rcl_interfaces::GET_PARAMETERS);
    check_service::<
        rcl_interfaces::GetParameterTypesRequest<'_>,
        rcl_interfaces::GetParameterTypesResponse<'_>,
    >(&rcl_interfaces::GET_PARAMETER_TYPES);
    check_service::<
        rcl_interfaces::ListParametersRequest<'_>,
        rcl_interfaces::ListParametersResponse<'_>,
    >(&rcl_interfaces::LIST_PARAMETERS);
    check_service::<
        rcl_interfaces::SetParametersRequest<'_>,
        rcl_interfaces::SetParametersResponse<'_>,
    >(&rcl_interfaces::SET_PARAMETERS);
    check_service::<
        rcl_interfaces::SetParametersAtomicallyRequest<'_>,
        rcl_interfaces::SetParametersAtomicallyResponse<'_>,
    >(&rcl_interfaces::SET_PARAMETERS_ATOMICALLY);
}

#[test]
fn service_hashes_are_the_published_ones() {
    for (service, hash) in [
        (&std_srvs::TRIGGER, "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"),
        (&std_srvs::SET_BOOL, "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"),
        (
            &rcl_interfaces::DESCRIBE_PARAMETERS,
            "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
        ),
        (
            &rcl_interfaces::GET_PARAMETERS,
            "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
        ),
        (
            &rcl_interfaces::GET_PARAMETER_TYPES,
            "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
        ),
        (
            &rcl_interfaces::LIST_PARAMETERS,
            "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
        ),
        (
            &rcl_interfaces::SET_PARAMETERS,
            "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
        ),
        (
            &rcl_interfaces::SET_PARAMETERS_ATOMICALLY,
            "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
        ),
    ] {
        assert_eq!(service.hash, format!("RIHS01_{hash}"), "{}", service.name);
    }
}
