//! The states of a managed node and the transitions between them: numbers, names and order are those of rcl.

use thiserror::Error;

/// A state; its discriminant is its number in `lifecycle_msgs/State`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum State {
    Unknown = 0,
    Unconfigured = 1,
    Inactive = 2,
    Active = 3,
    Finalized = 4,
    Configuring = 10,
    CleaningUp = 11,
    ShuttingDown = 12,
    Activating = 13,
    Deactivating = 14,
    ErrorProcessing = 15,
}

impl State {
    /// Every state, in rcl's order.
    pub(crate) const ALL: [Self; 11] = [
        Self::Unknown,
        Self::Unconfigured,
        Self::Inactive,
        Self::Active,
        Self::Finalized,
        Self::Configuring,
        Self::CleaningUp,
        Self::ShuttingDown,
        Self::Activating,
        Self::Deactivating,
        Self::ErrorProcessing,
    ];

    /// Returns its number.
    pub(crate) const fn id(self) -> u8 {
        self as u8
    }

    /// Returns its name.
    pub(crate) const fn label(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Unconfigured => "unconfigured",
            Self::Inactive => "inactive",
            Self::Active => "active",
            Self::Finalized => "finalized",
            Self::Configuring => "configuring",
            Self::CleaningUp => "cleaningup",
            Self::ShuttingDown => "shuttingdown",
            Self::Activating => "activating",
            Self::Deactivating => "deactivating",
            Self::ErrorProcessing => "errorprocessing",
        }
    }

    /// True if a node stays in this state until another one is requested.
    pub(crate) const fn is_primary(self) -> bool {
        self.id() <= Self::Finalized.id()
    }
}

/// A transition between two states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Transition {
    /// Its number in `lifecycle_msgs/Transition`.
    pub(crate) id: u8,
    /// Its name.
    pub(crate) label: &'static str,
    /// Start state.
    pub(crate) start: State,
    /// Goal state.
    pub(crate) goal: State,
}

const fn transition(id: u8, label: &'static str, start: State, goal: State) -> Transition {
    Transition { id, label, start, goal }
}

const SUCCESS: &str = "transition_success";
const FAILURE: &str = "transition_failure";
const ERROR: &str = "transition_error";

/// Every transition, in rcl's order.
pub(crate) const TRANSITIONS: [Transition; 25] = [
    transition(1, "configure", State::Unconfigured, State::Configuring),
    transition(10, SUCCESS, State::Configuring, State::Inactive),
    transition(11, FAILURE, State::Configuring, State::Unconfigured),
    transition(12, ERROR, State::Configuring, State::ErrorProcessing),
    transition(2, "cleanup", State::Inactive, State::CleaningUp),
    transition(20, SUCCESS, State::CleaningUp, State::Unconfigured),
    transition(21, FAILURE, State::CleaningUp, State::Inactive),
    transition(22, ERROR, State::CleaningUp, State::ErrorProcessing),
    transition(3, "activate", State::Inactive, State::Activating),
    transition(30, SUCCESS, State::Activating, State::Active),
    transition(31, FAILURE, State::Activating, State::Inactive),
    transition(32, ERROR, State::Activating, State::ErrorProcessing),
    transition(4, "deactivate", State::Active, State::Deactivating),
    transition(40, SUCCESS, State::Deactivating, State::Inactive),
    transition(41, FAILURE, State::Deactivating, State::Active),
    transition(42, ERROR, State::Deactivating, State::ErrorProcessing),
    transition(5, "shutdown", State::Unconfigured, State::ShuttingDown),
    transition(6, "shutdown", State::Inactive, State::ShuttingDown),
    transition(7, "shutdown", State::Active, State::ShuttingDown),
    transition(50, SUCCESS, State::ShuttingDown, State::Finalized),
    transition(51, FAILURE, State::ShuttingDown, State::Finalized),
    transition(52, ERROR, State::ShuttingDown, State::ErrorProcessing),
    transition(60, SUCCESS, State::ErrorProcessing, State::Unconfigured),
    transition(61, FAILURE, State::ErrorProcessing, State::Finalized),
    transition(62, ERROR, State::ErrorProcessing, State::Finalized),
];

/// A requested transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted<'a> {
    /// By its number.
    Id(u8),
    /// By its name.
    Label(&'a str),
}

impl Wanted<'_> {
    fn is(&self, transition: &Transition) -> bool {
        match *self {
            Self::Id(id) => transition.id == id,
            Self::Label(label) => transition.label == label,
        }
    }

    fn text(self) -> String {
        match self {
            Self::Label(label) => format!("{label:?}"),
            Self::Id(id) => TRANSITIONS
                .iter()
                .find(|transition| transition.id == id)
                .map_or_else(|| id.to_string(), |known| format!("{} ({id})", known.label)),
        }
    }
}

/// The requested transition cannot begin in this state.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("transition {wanted} cannot begin in state {}: allowed: {possible}", .state.label())]
pub(crate) struct Impossible {
    /// The requested transition.
    pub(crate) wanted: String,
    /// The state.
    pub(crate) state: State,
    /// The transitions that can start in this state.
    pub(crate) possible: String,
}

/// Result of a callback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// It succeeded.
    Success,
    /// It failed and changed nothing.
    Failure,
}

/// State machine of a node.
#[derive(Debug)]
pub(crate) struct Machine(State);

impl Default for Machine {
    fn default() -> Self {
        Self(State::Unconfigured)
    }
}

impl Machine {
    /// The state.
    pub(crate) const fn state(&self) -> State {
        self.0
    }

    /// Returns the transitions that begin in this state.
    pub(crate) fn available(&self) -> impl Iterator<Item = Transition> {
        let state = self.0;
        TRANSITIONS.into_iter().filter(move |transition| transition.start == state)
    }

    /// Begins a transition. The caller runs the callback, then calls [`end`](Self::end).
    ///
    /// # Errors
    /// The transition does not begin in this state. The end of a running transition cannot be requested.
    pub(crate) fn begin(&mut self, wanted: Wanted<'_>) -> Result<Transition, Impossible> {
        let found = self.available().find(|transition| wanted.is(transition));
        let Some(transition) = found.filter(|_| self.0.is_primary()) else {
            let labels: Vec<_> = self.available().map(|transition| transition.label).collect();
            let possible = match (self.0.is_primary(), labels.is_empty()) {
                (false, _) => "none until the running transition ends".to_owned(),
                (true, true) => "none".to_owned(),
                (true, false) => labels.join(", "),
            };
            return Err(Impossible { wanted: wanted.text(), state: self.0, possible });
        };
        self.0 = transition.goal;
        Ok(transition)
    }

    /// Ends the running transition with the result of its callback. Returns `None` if no transition is running.
    pub(crate) fn end(&mut self, ending: Ending) -> Option<Transition> {
        let label = match ending {
            Ending::Success => SUCCESS,
            Ending::Failure => FAILURE,
        };
        let transition = self.available().find(|transition| transition.label == label)?;
        self.0 = transition.goal;
        Some(transition)
    }
}
