//! Requests that wait for the node's answer.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Mutex,
};

use super::lock;
use crate::ros::transport::Responder;

/// Requests that may wait, of all services together. The results of actions wait for long.
const MAX_WAITING: usize = 256;

/// The requests of all services.
#[derive(Default)]
pub(super) struct Calls(Mutex<Open>);

#[derive(Default)]
struct Open {
    num_begun: u64,
    /// Service and responder, by number of the call.
    waiting: BTreeMap<u64, (u64, Responder)>,
    /// Services that take no more requests.
    ended: BTreeSet<u64>,
    is_closed: bool,
}

impl Calls {
    /// Begins a call of a service; returns its number, or `None` if the service ends or too many wait.
    pub(super) fn begin(&self, service: u64, responder: Responder) -> Option<u64> {
        let mut open = lock(&self.0);
        if open.is_closed || open.ended.contains(&service) {
            return None;
        }
        if open.waiting.len() >= MAX_WAITING {
            tracing::warn!("a request gets no response: {MAX_WAITING} others wait for theirs");
            return None;
        }
        open.num_begun += 1;
        let call = open.num_begun;
        open.waiting.insert(call, (service, responder));
        Some(call)
    }

    /// Sends the answer of a call; `None`: it gets none.
    pub(super) fn answer(&self, call: u64, answer: Option<Vec<u8>>) {
        let waiting = lock(&self.0).waiting.remove(&call);
        if let Some((_, responder)) = waiting {
            responder.respond(answer);
        }
    }

    /// Ends a service: its requests get no answer.
    pub(super) fn end(&self, service: u64) {
        let mut open = lock(&self.0);
        open.ended.insert(service);
        let ended: Vec<_> = open.waiting.extract_if(.., |_, (of, _)| *of == service).collect();
        // Dropped after unlocking: it wakes the service.
        drop(open);
        drop(ended);
    }

    /// Ends all services.
    pub(super) fn close(&self) {
        let mut open = lock(&self.0);
        open.is_closed = true;
        let ended = std::mem::take(&mut open.waiting);
        drop(open);
        drop(ended);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, RecvError, TryRecvError, sync_channel};

    use super::*;

    fn begin(calls: &Calls) -> (Option<u64>, Receiver<Option<Vec<u8>>>) {
        let (sender, answer) = sync_channel(1);
        let responder = Responder::new(move |answer| sender.send(answer).unwrap());
        (calls.begin(1, responder), answer)
    }

    #[test]
    fn an_answer_reaches_its_own_call_once() {
        let calls = Calls::default();
        let ((first, first_answer), (second, second_answer)) = (begin(&calls), begin(&calls));
        let (first, second) = (first.unwrap(), second.unwrap());
        calls.answer(second, Some(vec![2]));
        calls.answer(second, Some(vec![3]));
        calls.answer(first, None);
        assert_eq!(second_answer.iter().collect::<Vec<_>>(), [Some(vec![2])]);
        assert_eq!(first_answer.iter().collect::<Vec<_>>(), [None]);
    }

    #[test]
    fn a_service_that_ends_waits_no_longer() {
        let calls = Calls::default();
        let (_, answer) = begin(&calls);
        calls.end(2);
        assert!(answer.try_recv().is_err_and(|error| error == TryRecvError::Empty));
        calls.end(1);
        assert_eq!(answer.recv(), Err(RecvError));
        assert_eq!(begin(&calls).0, None);
        calls.close();
        let responder = Responder::new(|_| {});
        assert_eq!(calls.begin(3, responder), None);
    }

    #[test]
    fn the_number_of_waiting_calls_is_bounded() {
        let calls = Calls::default();
        let waiting: Vec<_> = (0..MAX_WAITING).map(|_| begin(&calls)).collect();
        assert!(waiting.iter().all(|(call, _)| call.is_some()));
        assert_eq!(begin(&calls).0, None);
        calls.answer(waiting[0].0.unwrap(), None);
        assert!(begin(&calls).0.is_some());
    }
}
