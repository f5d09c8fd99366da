//! Test support: messages filled with noise, and the wire layout of their structs.

use serde::{
    Deserialize,
    de::{DeserializeSeed, Deserializer, Expected, SeqAccess, Visitor, value::Error},
};

/// Calls `$function::<T>($arguments…)` for every message type.
macro_rules! for_each_message {
    ($function:ident, $($argument:expr),*) => {
        $crate::msg::noise::for_each_message!(
            @call $function ($($argument),*)
            builtin_interfaces::Time, builtin_interfaces::Duration, std_msgs::Header<'_>, sensor_msgs::Image<'_>,
            sensor_msgs::CompressedImage<'_>, sensor_msgs::CameraInfo<'_>, sensor_msgs::RegionOfInterest,
            sensor_msgs::PointCloud2<'_>, sensor_msgs::PointField<'_>, sensor_msgs::JointState<'_>,
            unique_identifier_msgs::Uuid, rosgraph_msgs::Clock, diagnostic_msgs::DiagnosticArray<'_>,
            diagnostic_msgs::DiagnosticStatus<'_>, diagnostic_msgs::KeyValue<'_>, foxglove_msgs::ImageAnnotations<'_>,
            foxglove_msgs::CircleAnnotation, foxglove_msgs::PointsAnnotation, foxglove_msgs::TextAnnotation<'_>,
            foxglove_msgs::Point2, foxglove_msgs::Color, laser_profiler_msgs::FrameTrace,
            laser_profiler_msgs::Centerline<'_>, laser_profiler_msgs::Profile<'_>, laser_profiler_msgs::SliceInfo<'_>,
            laser_profiler_msgs::StreamStatus<'_>, laser_profiler_msgs::EncoderStamped<'_>,
            scan::ScanGoal<'_>, scan::ScanResult<'_>, scan::ScanFeedback, scan::SendGoalRequest<'_>,
            scan::SendGoalResponse, scan::GetResultRequest, scan::GetResultResponse<'_>, scan::FeedbackMessage,
            action_msgs::GoalInfo, action_msgs::GoalStatus, action_msgs::GoalStatusArray,
            action_msgs::CancelGoalRequest, action_msgs::CancelGoalResponse,
            laser_profiler_msgs::StartScanRequest<'_>, laser_profiler_msgs::StartScanResponse<'_>,
            std_srvs::TriggerRequest, std_srvs::TriggerResponse<'_>, std_srvs::SetBoolRequest, std_srvs::SetBoolResponse<'_>,
            geometry_msgs::Vector3, geometry_msgs::Quaternion, geometry_msgs::Transform, geometry_msgs::TransformStamped<'_>,
            tf2_msgs::TFMessage<'_>, rosout::Log<'_>, lifecycle_msgs::State<'_>, lifecycle_msgs::Transition<'_>,
            lifecycle_msgs::TransitionDescription<'_>, lifecycle_msgs::TransitionEvent<'_>,
            lifecycle_msgs::ChangeStateRequest<'_>, lifecycle_msgs::ChangeStateResponse, lifecycle_msgs::GetStateRequest,
            lifecycle_msgs::GetStateResponse<'_>, lifecycle_msgs::GetAvailableStatesRequest,
            lifecycle_msgs::GetAvailableStatesResponse<'_>, lifecycle_msgs::GetAvailableTransitionsRequest,
            lifecycle_msgs::GetAvailableTransitionsResponse<'_>,
            rcl_interfaces::ParameterValue<'_>, rcl_interfaces::Parameter<'_>,
            rcl_interfaces::ParameterDescriptor<'_>, rcl_interfaces::FloatingPointRange,
            rcl_interfaces::IntegerRange, rcl_interfaces::ParameterEvent<'_>,
            rcl_interfaces::SetParametersResult<'_>, rcl_interfaces::ListParametersResult<'_>,
            rcl_interfaces::DescribeParametersRequest<'_>, rcl_interfaces::DescribeParametersResponse<'_>,
            rcl_interfaces::GetParametersRequest<'_>, rcl_interfaces::GetParametersResponse<'_>,
            rcl_interfaces::GetParameterTypesRequest<'_>, rcl_interfaces::GetParameterTypesResponse<'_>,
            rcl_interfaces::ListParametersRequest<'_>, rcl_interfaces::ListParametersResponse<'_>,
            rcl_interfaces::SetParametersRequest<'_>, rcl_interfaces::SetParametersResponse<'_>,
            rcl_interfaces::SetParametersAtomicallyRequest<'_>, rcl_interfaces::SetParametersAtomicallyResponse<'_>
        )
    };
    (@call $function:ident $arguments:tt $($message:ty),*) => {
        $($crate::msg::noise::for_each_message!(@one $function $message, $arguments);)*
    };
    (@one $function:ident $message:ty, ($($argument:expr),*)) => {
        $function::<$message>($($argument),*)
    };
}
pub(super) use for_each_message;

/// Returns a message filled with noise; zeros after the noise ends.
pub(super) fn message<'de, T: Deserialize<'de>>(noise: &'de [u8]) -> T {
    let mut source = Noise { bytes: noise, path: String::new(), layout: Vec::new(), single: false };
    T::deserialize(&mut source).unwrap()
}

/// Returns the wire layout of a struct as `path: kind` in order, with one element for each sequence.
pub(super) fn layout<'de, T: Deserialize<'de>>() -> Vec<String> {
    let mut source = Noise { bytes: &[], path: String::new(), layout: Vec::new(), single: true };
    T::deserialize(&mut source).unwrap();
    source.layout
}

/// Deserializer that yields noise and records the requested kinds.
struct Noise<'de> {
    bytes: &'de [u8],
    path: String,
    layout: Vec<String>,
    /// True if sequences have one element; otherwise 0 to 3.
    single: bool,
}

impl Noise<'_> {
    fn next<const N: usize>(&mut self) -> [u8; N] {
        let (head, tail) = self.bytes.split_at(N.min(self.bytes.len()));
        self.bytes = tail;
        let mut bytes = [0; N];
        bytes[..head.len()].copy_from_slice(head);
        bytes
    }

    fn note(&mut self, kind: &str) {
        self.layout.push(format!("{}: {kind}", self.path));
    }
}

/// Elements of a sequence or fields of a struct, each with its path segment.
struct Parts<'s, 'de> {
    source: &'s mut Noise<'de>,
    names: std::vec::IntoIter<String>,
}

impl<'de> SeqAccess<'de> for Parts<'_, 'de> {
    type Error = Error;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Error> {
        let Some(name) = self.names.next() else { return Ok(None) };
        let length = self.source.path.len();
        self.source.path.push_str(&name);
        let value = seed.deserialize(&mut *self.source);
        self.source.path.truncate(length);
        value.map(Some)
    }
}

macro_rules! number {
    ($method:ident, $visit:ident, $type:ty, $kind:literal) => {
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
            self.note($kind);
            visitor.$visit(<$type>::from_le_bytes(self.next()))
        }
    };
}

impl<'de> Deserializer<'de> for &mut Noise<'de> {
    type Error = Error;

    number!(deserialize_i8, visit_i8, i8, "int8");
    number!(deserialize_u8, visit_u8, u8, "uint8");
    number!(deserialize_u16, visit_u16, u16, "uint16");
    number!(deserialize_u32, visit_u32, u32, "uint32");
    number!(deserialize_u64, visit_u64, u64, "uint64");
    number!(deserialize_i32, visit_i32, i32, "int32");
    number!(deserialize_i64, visit_i64, i64, "int64");

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.note("float32");
        // Never NaN, which equals nothing.
        visitor.visit_f32(i32::from_le_bytes(self.next()) as f32 / 1024.0)
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.note("float64");
        visitor.visit_f64(i64::from_le_bytes(self.next()) as f64 / 1024.0)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.note("bool");
        let [byte] = self.next();
        visitor.visit_bool(byte % 2 == 1)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        self.note("string");
        let [byte] = self.next();
        visitor
            .visit_str(["", "x", "\u{3b2} = 30\u{b0}", "joint/with/slashes"][usize::from(byte % 4)])
    }

    fn deserialize_bytes<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let [byte] = self.next();
        // Our texts request bytes and state "text" as the expected value.
        let expected: &dyn Expected = &visitor;
        if expected.to_string().contains("text") {
            self.note("string");
            let texts: [&[u8]; 4] = [b"\0", b"camera\0", b"\xc2\xb5m\0", b"laser_plane\0"];
            return visitor.visit_borrowed_bytes(texts[usize::from(byte % 4)]);
        }
        self.note("uint8[]");
        let (bytes, rest) = self.bytes.split_at(usize::from(byte).min(self.bytes.len()));
        self.bytes = rest;
        visitor.visit_borrowed_bytes(bytes)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let [byte] = self.next();
        let length = if self.single { 1 } else { usize::from(byte % 4) };
        let names = vec!["[]".to_owned(); length].into_iter();
        visitor.visit_seq(Parts { source: self, names })
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        let names: Vec<_> = (0..length).map(|i| format!("[{i}]")).collect();
        visitor.visit_seq(Parts { source: self, names: names.into_iter() })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let names: Vec<_> = fields.iter().map(|field| format!(".{field}")).collect();
        visitor.visit_seq(Parts { source: self, names: names.into_iter() })
    }

    fn deserialize_any<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, Error> {
        panic!("{}: a kind that ROS messages do not have", self.path)
    }

    serde::forward_to_deserialize_any! {
        i16 char str byte_buf option unit unit_struct newtype_struct tuple_struct map enum identifier ignored_any
    }
}
