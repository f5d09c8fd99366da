//! The values in force while the node runs: a change counts when it is allowed, consistent and accepted.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::ros::{
    node_params::NodeParams, parameters::ParameterError, parameters::Parameters, value::Value,
};

/// Names the source of a value in messages.
const ORIGIN: &str = "refused";

/// Longest name that is looked at, bytes: longer ones would only fill messages.
const MAX_NAME_BYTES: usize = 255;

/// Hears of a change before it counts, and may refuse it with a reason. Both say the same: the values, and their types.
/// It must not ask the store, which waits for the answer.
pub type OnChange = Box<dyn Fn(&NodeParams, &Parameters) -> Result<(), String> + Send + Sync>;

/// The parameters of a running node.
pub struct ParameterStore {
    current: Mutex<Current>,
    on_change: OnChange,
}

struct Current {
    values: Parameters,
    params: NodeParams,
}

impl ParameterStore {
    /// Creates a store with these values; `on_change` is called for later changes only.
    ///
    /// # Errors
    /// Values that contradict one another.
    pub fn new(values: Parameters, on_change: OnChange) -> Result<Self, ParameterError> {
        let params = NodeParams::new(&values)?;
        Ok(Self { current: Mutex::new(Current { values, params }), on_change })
    }

    /// Calls `look` with the effective values.
    pub fn read<T>(&self, look: impl FnOnce(&Parameters) -> T) -> T {
        look(&self.lock().values)
    }

    /// Sets all of them, one after another, or none.
    ///
    /// # Errors
    /// Why not, in words: a name that is not declared, a value that is not allowed, values that contradict one another, a
    /// parameter that stands fast, or what the hearer of changes says.
    pub fn set_atomically(&self, wishes: &[(&str, Value)]) -> Result<(), String> {
        let mut current = self.lock();
        let mut values = current.values.clone();
        for (name, value) in wishes {
            if name.len() > MAX_NAME_BYTES {
                let length = name.len();
                return Err(format!(
                    "{ORIGIN}: a name of {length} bytes is longer than {MAX_NAME_BYTES}"
                ));
            }
            values.change(name, value.clone(), ORIGIN).map_err(|error| error.to_string())?;
        }
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
