//! The queue between threads, bounded in items and bytes, with a fixed behaviour when it is full.

use std::{
    collections::VecDeque,
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

/// Behaviour of a full queue when an item is pushed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WhenFull {
    /// Drops and counts the oldest items: for live input.
    DropOldest,
    /// Makes the sender wait for room: for replay.
    Wait,
}

/// Bound of a queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bound {
    /// Items, at least 1.
    pub(crate) items: usize,
    /// Bytes of all items together. An item larger than this passes only through an empty queue.
    pub(crate) bytes: usize,
}

/// Maximum number of urgent items; a push beyond that returns an error.
const MAX_URGENT: usize = 64;

/// The queue is closed or full of urgent items; returns the item.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Closed<T>(pub T);

/// Result of a pop.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Popped<T> {
    /// The next item, and the number of items dropped before it.
    Item(T, u32),
    /// The deadline passed.
    TimedOut,
    /// The queue is closed and empty.
    Closed,
}

struct State<T> {
    /// Popped before all others, never dropped.
    urgent: VecDeque<T>,
    items: VecDeque<(T, usize)>,
    bytes: usize,
    /// Items dropped since the last pop.
    num_dropped: u32,
    /// Threads that wait for an item, and for room. Counted because a notification costs a system call even if no
    /// thread waits.
    num_takers: usize,
    num_senders: usize,
    is_closed: bool,
}

/// A queue for any number of senders and receivers.
pub(crate) struct Queue<T> {
    bound: Bound,
    when_full: WhenFull,
    state: Mutex<State<T>>,
    has_item: Condvar,
    has_room: Condvar,
}

impl<T> Queue<T> {
    /// Creates an open, empty queue.
    pub(crate) fn new(bound: Bound, when_full: WhenFull) -> Self {
        let bound = Bound { items: bound.items.max(1), ..bound };
        let items = VecDeque::with_capacity(bound.items);
        let urgent = VecDeque::with_capacity(MAX_URGENT);
        let state = State {
            urgent,
            items,
            bytes: 0,
            num_dropped: 0,
            num_takers: 0,
            num_senders: 0,
            is_closed: false,
        };
        Self {
            bound,
            when_full,
            state: Mutex::new(state),
            has_item: Condvar::new(),
            has_room: Condvar::new(),
        }
    }

    /// Appends an item of `bytes` bytes. Returns the number of older items dropped for it.
    ///
    /// # Errors
    /// The queue is closed or was closed while waiting for room.
    pub(crate) fn push(&self, item: T, bytes: usize) -> Result<usize, Closed<T>> {
        let mut state = self.lock();
        let mut num_dropped = 0;
        while !state.is_closed && !self.has_room_for(&state, bytes) {
            match self.when_full {
                WhenFull::Wait => {
                    state.num_senders += 1;
                    state = self.has_room.wait(state).unwrap_or_else(PoisonError::into_inner);
                    state.num_senders -= 1;
                }
                WhenFull::DropOldest => {
                    state.take();
                    state.num_dropped = state.num_dropped.saturating_add(1);
                    num_dropped += 1;
                }
            }
        }
        if state.is_closed {
            return Err(Closed(item));
        }
        state.items.push_back((item, bytes));
        state.bytes += bytes;
        self.notify_receiver(state);
        Ok(num_dropped)
    }

    /// Inserts an item before all normal items. It is never dropped.
    ///
    /// # Errors
    /// The queue is closed or full of urgent items.
    pub(crate) fn push_urgent(&self, item: T) -> Result<(), Closed<T>> {
        let mut state = self.lock();
        if state.is_closed || state.urgent.len() == MAX_URGENT {
            return Err(Closed(item));
        }
        state.urgent.push_back(item);
        self.notify_receiver(state);
        Ok(())
    }

    /// Waits for the next item. `None`: the queue is closed and empty.
    pub(crate) fn pop(&self) -> Option<T> {
        match self.pop_counted(None) {
            Popped::Item(item, _) => Some(item),
            Popped::TimedOut | Popped::Closed => None,
        }
    }

    /// Waits for the next item until `deadline`. Returns it with the number of items dropped since the previous pop.
    pub(crate) fn pop_counted(&self, deadline: Option<Instant>) -> Popped<T> {
        let mut state = self.lock();
        loop {
            if let Some(item) = state.urgent.pop_front() {
                return Popped::Item(item, 0);
            }
            if let Some(item) = state.take() {
                let num_dropped = std::mem::take(&mut state.num_dropped);
                let is_awaited = state.num_senders > 0;
                drop(state);
                if is_awaited {
                    self.has_room.notify_all();
                }
                return Popped::Item(item, num_dropped);
            }
            if state.is_closed {
                return Popped::Closed;
            }
            let wait = deadline.map(|deadline| deadline.checked_duration_since(Instant::now()));
            if wait == Some(None) {
                return Popped::TimedOut;
            }
            state.num_takers += 1;
            state = match wait.flatten() {
                None => self.has_item.wait(state).unwrap_or_else(PoisonError::into_inner),
                Some(wait) => {
                    let waited = self.has_item.wait_timeout(state, wait);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
            };
            state.num_takers -= 1;
        }
    }

    fn notify_receiver(&self, state: MutexGuard<'_, State<T>>) {
        let is_awaited = state.num_takers > 0;
        drop(state);
        if is_awaited {
            self.has_item.notify_one();
        }
    }

    /// Closes the queue for further items; queued items can still be popped.
    pub(crate) fn close(&self) {
        self.lock().is_closed = true;
        self.has_item.notify_all();
        self.has_room.notify_all();
    }

    /// Number of queued items, without the urgent ones.
    pub(crate) fn len(&self) -> usize {
        self.lock().items.len()
    }

    /// Locks the state. Every change under the lock is atomic, so the state is valid even after a panic.
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has_room_for(&self, state: &State<T>, bytes: usize) -> bool {
        let fits = state.items.len() < self.bound.items
            && state.bytes.saturating_add(bytes) <= self.bound.bytes;
        fits || state.items.is_empty()
    }
}

impl<T> State<T> {
    fn take(&mut self) -> Option<T> {
        let (item, bytes) = self.items.pop_front()?;
        self.bytes -= bytes;
        Some(item)
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::Arc, thread, time::Duration};

    use super::*;

    fn queue(items: usize, bytes: usize, when_full: WhenFull) -> Arc<Queue<u32>> {
        Arc::new(Queue::new(Bound { items, bytes }, when_full))
    }

    #[test]
    fn items_come_out_in_order() {
        let queue = queue(3, 100, WhenFull::Wait);
        for item in 0..3 {
            assert_eq!(queue.push(item, 10), Ok(0));
        }
        assert_eq!([queue.pop(), queue.pop(), queue.pop()], [Some(0), Some(1), Some(2)]);
    }

    #[test]
    fn drop_oldest_counts_what_it_drops() {
        let queue = queue(2, 100, WhenFull::DropOldest);
        let dropped: Vec<_> = (0..4).map(|item| queue.push(item, 10).unwrap()).collect();
        assert_eq!(dropped, [0, 0, 1, 1]);
        assert_eq!(queue.push(9, 95), Ok(2), "bytes count too");
        assert_eq!((queue.len(), queue.pop()), (1, Some(9)));
        assert_eq!(queue.push(10, 1000), Ok(0), "larger than the bound, but alone");
    }

    #[test]
    fn urgent_items_come_first_and_are_never_dropped() {
        let queue = queue(2, 100, WhenFull::DropOldest);
        for item in 0..3 {
            queue.push(item, 1).unwrap();
        }
        assert_eq!(queue.push_urgent(10), Ok(()));
        for item in 3..9 {
            queue.push(item, 1).unwrap();
        }
        assert_eq!(queue.pop_counted(None), Popped::Item(10, 0));
        assert_eq!(queue.pop_counted(None), Popped::Item(7, 7));
        let refused = (0..1000).find(|&item| queue.push_urgent(item).is_err());
        assert_eq!(refused, Some(64), "bounded too");
    }

    #[test]
    fn an_item_carries_the_number_dropped_before_it() {
        let queue = queue(2, 100, WhenFull::DropOldest);
        let push = |items: std::ops::Range<u32>| {
            for item in items {
                queue.push(item, 1).unwrap();
            }
        };
        push(0..5);
        assert_eq!(queue.pop_counted(None), Popped::Item(3, 3));
        assert_eq!(queue.pop_counted(None), Popped::Item(4, 0));
        push(5..8);
        assert_eq!(queue.pop_counted(None), Popped::Item(6, 1));
    }

    /// Producers and consumers that would overrun any bound if it did not hold.
    #[test]
    fn waiting_drops_nothing_and_keeps_the_bound() {
        let queue = queue(4, 50, WhenFull::Wait);
        let senders: Vec<_> = (0..3)
            .map(|sender| {
                let queue = Arc::clone(&queue);
                thread::spawn(move || {
                    for item in 0..1000 {
                        assert_eq!(queue.push(sender * 1000 + item, 20), Ok(0));
                        assert!(queue.len() <= 2, "50 bytes hold two items of 20");
                    }
                })
            })
            .collect();
        let receiver = {
            let queue = Arc::clone(&queue);
            thread::spawn(move || std::iter::from_fn(|| queue.pop()).collect::<Vec<_>>())
        };
        for sender in senders {
            sender.join().unwrap();
        }
        queue.close();
        let received = receiver.join().unwrap();
        for sender in 0..3 {
            let of_sender = received.iter().filter(|item| *item / 1000 == sender);
            assert!(
                of_sender.copied().eq(sender * 1000..sender * 1000 + 1000),
                "in order, complete"
            );
        }
    }

    #[test]
    fn closing_wakes_a_waiting_sender_and_a_waiting_receiver() {
        let full = queue(1, 100, WhenFull::Wait);
        full.push(1, 1).unwrap();
        let sender = {
            let full = Arc::clone(&full);
            thread::spawn(move || full.push(2, 1))
        };
        let empty = queue(1, 100, WhenFull::Wait);
        let receiver = {
            let empty = Arc::clone(&empty);
            thread::spawn(move || empty.pop())
        };
        full.close();
        empty.close();
        assert_eq!(sender.join().unwrap(), Err(Closed(2)));
        assert_eq!(receiver.join().unwrap(), None);
        assert_eq!((full.pop(), full.pop()), (Some(1), None), "queued items are still returned");
    }

    #[test]
    fn a_deadline_ends_the_wait() {
        let queue = queue(1, 100, WhenFull::Wait);
        assert_eq!(queue.pop_counted(Some(Instant::now())), Popped::TimedOut);
        queue.push(1, 1).unwrap();
        let far = Instant::now() + Duration::from_hours(1);
        assert_eq!(queue.pop_counted(Some(far)), Popped::Item(1, 0));
        queue.close();
        assert_eq!(queue.pop_counted(Some(far)), Popped::Closed);
    }
}
