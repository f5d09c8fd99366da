//! The effective values while the node runs. A change takes effect if it is allowed, consistent and accepted.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::{
    node::allowed_directories::AllowedDirectories,
    ros::{
        node_params::NodeParams, parameters::ParameterError, parameters::Parameters, value::Value,
    },
};

/// Names the source of a value in messages.
const ORIGIN: &str = "refused";

/// Longest accepted name, bytes: longer ones would only enlarge messages.
const MAX_NAME_BYTES: usize = 255;

/// Called before a change takes effect; may refuse it with a reason. Both arguments hold the same values, typed and
/// raw. Must not call the store, which waits for the result.
pub(crate) type OnChange =
    Box<dyn Fn(&NodeParams, &Parameters) -> Result<(), String> + Send + Sync>;

/// The parameters of a running node.
pub(crate) struct ParameterStore {
    current: Mutex<Current>,
    /// Where changed values may name files.
    allowed: AllowedDirectories,
    on_change: OnChange,
}

struct Current {
    values: Parameters,
    params: NodeParams,
}

impl ParameterStore {
    /// Creates a store with these values; `on_change` is called only for later changes. These may name files only where
    /// the values of the start do.
    ///
    /// # Errors
    /// Values that contradict one another.
    pub(crate) fn new(values: Parameters, on_change: OnChange) -> Result<Self, ParameterError> {
        let params = NodeParams::new(&values)?;
        let allowed = AllowedDirectories::of(&values);
        Ok(Self { current: Mutex::new(Current { values, params }), allowed, on_change })
    }

    /// Calls `look` with the effective values.
    pub(crate) fn read<T>(&self, look: impl FnOnce(&Parameters) -> T) -> T {
        look(&self.lock().values)
    }

    /// Sets all parameters in order, or none.
    ///
    /// # Errors
    /// The reason as text: a name is not declared, a value is not allowed, a file is outside the allowed directories,
    /// values contradict one another, a parameter
    /// is read-only, or `on_change` refuses the change.
    pub(crate) fn set_atomically(&self, changes: &[(&str, Value)]) -> Result<(), String> {
        let mut current = self.lock();
        let mut values = current.values.clone();
        for (name, value) in changes {
            if name.len() > MAX_NAME_BYTES {
                let length = name.len();
                return Err(format!(
                    "{ORIGIN}: a name of {length} bytes is longer than {MAX_NAME_BYTES}"
                ));
            }
            values.change(name, value.clone(), ORIGIN).map_err(|error| error.to_string())?;
        }
        let outside = |reason| format!("{ORIGIN}: {reason}");
        self.allowed.check(&current.values, &values).map_err(outside)?;
        let params = NodeParams::new(&values).map_err(|error| format!("{ORIGIN}: {error}"))?;
        if params != current.params {
            (self.on_change)(&params, &values)?;
        }
        *current = Current { values, params };
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Current> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
