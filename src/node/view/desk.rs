//! Translates viewer requests: parameters into ROS parameters, playback requests into orders to the player.

use std::sync::{Arc, OnceLock};

use serde_json::Value as Json;

use crate::{
    foxglove::{
        Desk, Parameter, ParameterType, ParameterValue, PlaybackControlRequest, PlaybackState,
    },
    node::parameter_server::{ParameterHandle, ParameterStore},
    ros::{
        parameters::{Declared, Parameters},
        value::Value,
    },
};

use super::playback::Playback;

/// The parameters of the viewed node or replay.
pub(super) trait Settable: Send + Sync {
    /// Calls `look` with the current values.
    fn read(&self, look: &mut dyn FnMut(&Parameters));

    /// Sets a parameter.
    ///
    /// # Errors
    /// The reason that the value was refused, as text.
    fn set(&self, name: &str, value: Value) -> Result<(), String>;
}

impl Settable for ParameterStore {
    fn read(&self, look: &mut dyn FnMut(&Parameters)) {
        Self::read(self, |values| look(values));
    }

    fn set(&self, name: &str, value: Value) -> Result<(), String> {
        self.set_atomically(&[(name, value)])
    }
}

impl Settable for ParameterHandle {
    fn read(&self, look: &mut dyn FnMut(&Parameters)) {
        Self::read(self, |values| look(values));
    }

    fn set(&self, name: &str, value: Value) -> Result<(), String> {
        Self::set(self, name, value)
    }
}

/// Handler of the viewer requests to a node. It has no parameters or playback until they are set.
#[derive(Default)]
pub(super) struct NodeDesk {
    settable: OnceLock<Arc<dyn Settable>>,
    playback: OnceLock<Playback>,
}

impl NodeDesk {
    /// Sets the source of the parameters. Only the first call has an effect.
    pub(super) fn set_parameters_of(&self, settable: Arc<dyn Settable>) {
        _ = self.settable.set(settable);
    }

    /// Sets the player. Only the first call has an effect.
    pub(super) fn set_playback(&self, playback: Playback) {
        _ = self.playback.set(playback);
    }

    fn set_one(settable: &dyn Settable, parameter: Parameter) -> Result<(), String> {
        let Parameter { name, value, .. } = parameter;
        let mut current = None;
        settable.read(&mut |values| current = values.get(&name).map(|it| it.value().clone()));
        let value = value.ok_or_else(|| format!("{name}: a parameter always has a value"))?;
        let value = value_for(value, current.as_ref()).map_err(|why| format!("{name}: {why}"))?;
        settable.set(&name, value)
    }
}

impl Desk for NodeDesk {
    fn parameters(&self, names: &[String]) -> Vec<Parameter> {
        let mut found = Vec::new();
        if let Some(settable) = self.settable.get() {
            settable.read(&mut |values| {
                let is_meant =
                    |it: &&Declared| names.is_empty() || names.iter().any(|name| name == it.name());
                found = values.iter().filter(is_meant).map(parameter).collect();
            });
        }
        found
    }

    fn set_parameters(&self, parameters: Vec<Parameter>) -> Vec<String> {
        let Some(settable) = self.settable.get() else {
            return vec!["the node is still starting: try again".to_owned()];
        };
        parameters
            .into_iter()
            .filter_map(|parameter| Self::set_one(&**settable, parameter).err())
            .collect()
    }

    fn control(&self, request: &PlaybackControlRequest) -> Option<PlaybackState> {
        self.playback.get().map(|playback| playback.control(request))
    }

    fn on_viewer(&self) {
        self.playback.get().into_iter().for_each(Playback::on_viewer);
    }

    fn on_subscribe(&self, _topic: &str) {
        self.playback.get().into_iter().for_each(Playback::on_subscribe);
    }
}

fn parameter(declared: &Declared) -> Parameter {
    let (kind, value) = match declared.value() {
        Value::Bool(value) => (None, ParameterValue::Bool(*value)),
        Value::Integer(value) => (None, ParameterValue::Integer(*value)),
        // In JSON, 35.0 is written like an integer.
        Value::Float(value) => (Some(ParameterType::Float64), ParameterValue::Float64(*value)),
        Value::Text(text) => (None, ParameterValue::String(text.clone())),
        Value::TextList(texts) => {
            (None, ParameterValue::Array(texts.iter().cloned().map(Json::String).collect()))
        }
    };
    Parameter { name: declared.name().to_owned(), r#type: kind, value: Some(value) }
}

/// Converts a viewer's value to the node's type. Viewers write 35 for 35.0 and vice versa, so the type of the current
/// value decides.
fn value_for(value: ParameterValue, current: Option<&Value>) -> Result<Value, String> {
    match value {
        ParameterValue::Bool(value) => Ok(Value::Bool(value)),
        ParameterValue::Integer(value) if matches!(current, Some(Value::Float(_))) => {
            Ok(Value::Float(value as f64))
        }
        ParameterValue::Integer(value) => Ok(Value::Integer(value)),
        ParameterValue::Float64(value)
            if matches!(current, Some(Value::Integer(_)))
                && value.fract() == 0.0
                && value.abs() < 2_f64.powi(53) =>
        {
            Ok(Value::Integer(value as i64))
        }
        ParameterValue::Float64(value) => Ok(Value::Float(value)),
        ParameterValue::String(text) => Ok(Value::Text(text)),
        ParameterValue::Array(items) => {
            let text = |item| match item {
                Json::String(text) => Ok(text),
                _ => Err("list parameters of this node hold texts only".to_owned()),
            };
            Ok(Value::TextList(items.into_iter().map(text).collect::<Result<_, _>>()?))
        }
        ParameterValue::Dict(_) => Err("no parameter of this node is a dictionary".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn desk() -> NodeDesk {
        let store = ParameterStore::new(Parameters::default(), Box::new(|_, _| Ok(()))).unwrap();
        let desk = NodeDesk::default();
        desk.set_parameters_of(Arc::new(store));
        desk
    }

    fn parameter_of(name: &str, value: ParameterValue) -> Parameter {
        Parameter { name: name.to_owned(), r#type: None, value: Some(value) }
    }

    fn value(desk: &NodeDesk, name: &str) -> Option<ParameterValue> {
        desk.parameters(&[name.to_owned()]).pop()?.value
    }

    #[test]
    fn numbers_are_converted_to_the_type_of_the_parameter() {
        let desk = desk();
        let parameters = vec![
            parameter_of("extraction.segment_threshold", ParameterValue::Integer(45)),
            parameter_of("slice.profiles", ParameterValue::Float64(7.0)),
            parameter_of("extraction.method", ParameterValue::String("gray_gravity".to_owned())),
        ];
        assert_eq!(desk.set_parameters(parameters), Vec::<String>::new());
        let threshold = desk.parameters(&["extraction.segment_threshold".to_owned()]);
        assert_eq!(threshold[0].value, Some(ParameterValue::Float64(45.0)));
        assert_eq!(threshold[0].r#type, Some(ParameterType::Float64));
        assert_eq!(value(&desk, "slice.profiles"), Some(ParameterValue::Integer(7)));
        assert_eq!(desk.parameters(&[]).len(), Parameters::default().iter().count());
    }

    #[test]
    fn a_refused_value_is_reported_and_changes_nothing() {
        let desk = desk();
        let refused =
            |name: &str, value| desk.set_parameters(vec![parameter_of(name, value)]).join("\n");
        for (name, value, words) in [
            ("slice.profiles", ParameterValue::Integer(0), "must be an integer from 1"),
            ("slice.profiles", ParameterValue::Float64(1.5), "not a float"),
            ("extraction.method", ParameterValue::String("best".to_owned()), "one of "),
            ("slice.profile", ParameterValue::Integer(1), "no parameter is called"),
            ("cameras", ParameterValue::Array(vec!["left".into()]), "read-only"),
            ("cameras", ParameterValue::Array(vec![1.into()]), "texts only"),
            ("channel", ParameterValue::Dict(serde_json::Map::new()), "dictionary"),
        ] {
            let before = all_values(&desk);
            let reason = refused(name, value);
            assert!(reason.contains(words) && reason.contains(name), "{reason}");
            assert_eq!(all_values(&desk), before);
        }
        let unset =
            Parameter { value: None, ..parameter_of("channel", ParameterValue::Bool(true)) };
        assert!(desk.set_parameters(vec![unset])[0].contains("always has a value"));
        assert!(!NodeDesk::default().set_parameters(Vec::new()).is_empty());
    }

    fn all_values(desk: &NodeDesk) -> Vec<Parameter> {
        desk.parameters(&[])
    }
}
