//! The six services that read and set parameters.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{
    ListParametersResult, Parameter, ParameterDescriptor, ParameterValue, SetParametersResult, Text,
};
use crate::msg::schema::{ServiceType, message, request_text, response_text};

/// Service that describes parameters.
pub(crate) const DESCRIBE_PARAMETERS: ServiceType = ServiceType {
    name: "rcl_interfaces/srv/DescribeParameters",
    text: include_str!("../definitions/rcl_interfaces/DescribeParameters.srv"),
    hash: "RIHS01_845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
};

/// Service that returns values.
pub(crate) const GET_PARAMETERS: ServiceType = ServiceType {
    name: "rcl_interfaces/srv/GetParameters",
    text: include_str!("../definitions/rcl_interfaces/GetParameters.srv"),
    hash: "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
};

/// Service that returns types.
pub(crate) const GET_PARAMETER_TYPES: ServiceType = ServiceType {
    name: "rcl_interfaces/srv/GetParameterTypes",
    text: include_str!("../definitions/rcl_interfaces/GetParameterTypes.srv"),
    hash: "RIHS01_da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
};

/// Service that lists names.
pub(crate) const LIST_PARAMETERS: ServiceType = ServiceType {
    name: "rcl_interfaces/srv/ListParameters",
    text: include_str!("../definitions/rcl_interfaces/ListParameters.srv"),
    hash: "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
};

/// Service that sets parameters one after another.
pub(crate) const SET_PARAMETERS: ServiceType = ServiceType {
    name: "rcl_interfaces/srv/SetParameters",
    text: include_str!("../definitions/rcl_interfaces/SetParameters.srv"),
    hash: "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
};

/// Service that sets all parameters or none.
pub(crate) const SET_PARAMETERS_ATOMICALLY: ServiceType = ServiceType {
    name: "rcl_interfaces/srv/SetParametersAtomically",
    text: include_str!("../definitions/rcl_interfaces/SetParametersAtomically.srv"),
    hash: "RIHS01_0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
};

/// Request of [`DESCRIBE_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DescribeParametersRequest<'a> {
    /// Full names.
    #[serde(borrow)]
    pub(crate) names: Vec<Text<'a>>,
}

/// Response of [`DESCRIBE_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct DescribeParametersResponse<'a> {
    /// One for each name, in order; of type `NOT_SET` if there is no such parameter.
    #[serde(borrow)]
    pub(crate) descriptors: Vec<ParameterDescriptor<'a>>,
}

/// Request of [`GET_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct GetParametersRequest<'a> {
    /// Full names.
    #[serde(borrow)]
    pub(crate) names: Vec<Text<'a>>,
}

/// Response of [`GET_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct GetParametersResponse<'a> {
    /// One for each name, in order; of type `NOT_SET` if there is no such parameter.
    #[serde(borrow)]
    pub(crate) values: Vec<ParameterValue<'a>>,
}

/// Request of [`GET_PARAMETER_TYPES`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct GetParameterTypesRequest<'a> {
    /// Full names.
    #[serde(borrow)]
    pub(crate) names: Vec<Text<'a>>,
}

/// Response of [`GET_PARAMETER_TYPES`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct GetParameterTypesResponse<'a> {
    /// One for each name, in order: a constant of [`parameter_type`](super::parameter_type).
    #[serde(borrow, with = "serde_bytes")]
    pub(crate) types: Cow<'a, [u8]>,
}

/// Request of [`LIST_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ListParametersRequest<'a> {
    /// Prefixes of the names, up to a dot; empty: all names.
    #[serde(borrow)]
    pub(crate) prefixes: Vec<Text<'a>>,
    /// Number of levels below the prefix; 0: all.
    pub(crate) depth: u64,
}

/// Response of [`LIST_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ListParametersResponse<'a> {
    /// Names.
    #[serde(borrow)]
    pub(crate) result: ListParametersResult<'a>,
}

/// Request of [`SET_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SetParametersRequest<'a> {
    /// Parameters, set one after another.
    #[serde(borrow)]
    pub(crate) parameters: Vec<Parameter<'a>>,
}

/// Response of [`SET_PARAMETERS`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SetParametersResponse<'a> {
    /// One for each parameter, in order.
    #[serde(borrow)]
    pub(crate) results: Vec<SetParametersResult<'a>>,
}

/// Request of [`SET_PARAMETERS_ATOMICALLY`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SetParametersAtomicallyRequest<'a> {
    /// Parameters, all set or none.
    #[serde(borrow)]
    pub(crate) parameters: Vec<Parameter<'a>>,
}

/// Response of [`SET_PARAMETERS_ATOMICALLY`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SetParametersAtomicallyResponse<'a> {
    /// Result of the request.
    #[serde(borrow)]
    pub(crate) result: SetParametersResult<'a>,
}

message!(
    DescribeParametersRequest<'_>,
    "rcl_interfaces/srv/DescribeParameters_Request",
    request_text(DESCRIBE_PARAMETERS.text),
    "RIHS01_05dd1c2bc87dec2627105c8070d6f9725c781a4f2ab852975bf105462b82b644",
    []
);
message!(
    DescribeParametersResponse<'_>,
    "rcl_interfaces/srv/DescribeParameters_Response",
    response_text(DESCRIBE_PARAMETERS.text),
    "RIHS01_ad6747319613c6131589e062e095b469a46cc764f7d0f12a001a49e6cd893995",
    [ParameterDescriptor<'_>]
);
message!(
    GetParametersRequest<'_>,
    "rcl_interfaces/srv/GetParameters_Request",
    request_text(GET_PARAMETERS.text),
    "RIHS01_135a9e1c3d7cebef792f6687d7ddf99949b21a0bd9a320d863a9110a3f5cf4d6",
    []
);
message!(
    GetParametersResponse<'_>,
    "rcl_interfaces/srv/GetParameters_Response",
    response_text(GET_PARAMETERS.text),
    "RIHS01_9fa773b46e39cc5d02db6224d8fd520bb9caeeffc2b27c96c1e59431baba9f2a",
    [ParameterValue<'_>]
);
message!(
    GetParameterTypesRequest<'_>,
    "rcl_interfaces/srv/GetParameterTypes_Request",
    request_text(GET_PARAMETER_TYPES.text),
    "RIHS01_87d7ec5ef545d4daa289d500025d31fb2437bc8b8365ca367161c4dac4be33fd",
    []
);
message!(
    GetParameterTypesResponse<'_>,
    "rcl_interfaces/srv/GetParameterTypes_Response",
    response_text(GET_PARAMETER_TYPES.text),
    "RIHS01_ac1335dce67c478e669434f6ac2fbff34fcd529580f272d3006785ba8b54e47f",
    []
);
message!(
    ListParametersRequest<'_>,
    "rcl_interfaces/srv/ListParameters_Request",
    request_text(LIST_PARAMETERS.text),
    "RIHS01_a1b0b5d6b967a5b8ac5bc8563c3ea678f349e312a6a4967227c5a96bc5ce38df",
    []
);
message!(
    ListParametersResponse<'_>,
    "rcl_interfaces/srv/ListParameters_Response",
    response_text(LIST_PARAMETERS.text),
    "RIHS01_31b937b82de3612426be79f231e386259f97e8dc843e3f2845288b4bfa296bdd",
    [ListParametersResult<'_>]
);
message!(
    SetParametersRequest<'_>,
    "rcl_interfaces/srv/SetParameters_Request",
    request_text(SET_PARAMETERS.text),
    "RIHS01_130d46386b7e84ea9ecf60608a4d83cbe5e5cb7c6cc5b712b7a4e3a6c254e932",
    [Parameter<'_>]
);
message!(
    SetParametersResponse<'_>,
    "rcl_interfaces/srv/SetParameters_Response",
    response_text(SET_PARAMETERS.text),
    "RIHS01_7a0e8140a0b8d98308fa81a5403a766e610af29a239caf54b7553227906fc266",
    [SetParametersResult<'_>]
);
message!(
    SetParametersAtomicallyRequest<'_>,
    "rcl_interfaces/srv/SetParametersAtomically_Request",
    request_text(SET_PARAMETERS_ATOMICALLY.text),
    "RIHS01_db0bd950ed5ed867a0e90b225e44dea382d762c0762ff3e0ee842190042a59e5",
    [Parameter<'_>]
);
message!(
    SetParametersAtomicallyResponse<'_>,
    "rcl_interfaces/srv/SetParametersAtomically_Response",
    response_text(SET_PARAMETERS_ATOMICALLY.text),
    "RIHS01_31b1a38c5b0b9d893ee24da45f69638f4561c78461d82d52750f429b534502b8",
    [SetParametersResult<'_>]
);
