//! The goals of an action: one at a time is active, the others are kept with their results.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use crate::{
    msg::{
        action_msgs::{CancelGoalResponse, GoalInfo, GoalStatus, cancel, status},
        builtin_interfaces::Time,
        unique_identifier_msgs::Uuid,
    },
    ros::transport::Responder,
};

/// Time for which the result of a goal is kept.
const RESULT_TIMEOUT: Duration = Duration::from_mins(15);
/// Largest number of goals with a result.
const MAX_KEPT: usize = 64;
/// Largest number of clients that wait for the result of a goal.
const MAX_WAITING: usize = 64;

/// The goals of one action.
#[derive(Default)]
pub(super) struct Goals {
    /// The oldest first.
    goals: VecDeque<Goal>,
    /// The goal that is being checked.
    reserved: Option<Uuid>,
    is_closed: bool,
}

struct Goal {
    info: GoalInfo,
    status: i8,
    waiting: Vec<Responder>,
    /// Response to who asks, and the time of the end.
    result: Option<(Vec<u8>, Instant)>,
}

/// Treatment of a request for a result.
pub(super) enum Waiting {
    /// It waits for the end of the goal.
    Until,
    /// The goal has ended.
    No(Responder, Vec<u8>),
    /// There is no such goal.
    Unknown(Responder),
}

impl Goals {
    /// Makes sure that no other goal begins before [`begin`](Self::begin) or [`release`](Self::release).
    ///
    /// # Errors
    /// The reason to reject the goal.
    pub(super) fn reserve(&mut self, goal_id: Uuid) -> Result<(), String> {
        if self.is_closed {
            return Err("the node is shutting down".to_owned());
        }
        if self.find(goal_id).is_some() || self.reserved == Some(goal_id) {
            return Err("its identity is that of an earlier goal".to_owned());
        }
        if self.reserved.is_some() || self.goals.iter().any(|goal| goal.result.is_none()) {
            return Err("another goal is active: cancel it, or wait for its result".to_owned());
        }
        self.reserved = Some(goal_id);
        Ok(())
    }

    pub(super) fn release(&mut self) {
        self.reserved = None;
    }

    /// Accepts the reserved goal.
    pub(super) fn begin(&mut self, info: GoalInfo) {
        self.release();
        if self.goals.len() == MAX_KEPT {
            self.goals.pop_front();
        }
        let (status, waiting) = (status::EXECUTING, Vec::new());
        self.goals.push_back(Goal { info, status, waiting, result: None });
    }

    /// Accepts no more goals.
    pub(super) fn close(&mut self) {
        self.is_closed = true;
    }

    /// True once no more goals are accepted.
    pub(super) const fn is_closed(&self) -> bool {
        self.is_closed
    }

    fn find(&mut self, goal_id: Uuid) -> Option<&mut Goal> {
        self.goals.iter_mut().find(|goal| goal.info.goal_id == goal_id)
    }

    /// Marks goals as being cancelled: that of the identity, those accepted up to the stamp, or, with neither, all.
    pub(super) fn cancel(&mut self, wanted: GoalInfo) -> CancelGoalResponse {
        let (is_named, is_timed) =
            (wanted.goal_id != Uuid::default(), wanted.stamp != Time::default());
        let is_meant = |goal: &Goal| {
            let is_early = is_timed && goal.info.stamp.to_ns() <= wanted.stamp.to_ns();
            (is_named && goal.info.goal_id == wanted.goal_id) || is_early || !(is_named || is_timed)
        };
        let return_code = match self.find(wanted.goal_id) {
            _ if !is_named => cancel::NONE,
            None => cancel::UNKNOWN_GOAL_ID,
            Some(goal) if goal.result.is_some() => cancel::GOAL_TERMINATED,
            Some(_) => cancel::NONE,
        };
        let mut goals_canceling = Vec::new();
        for goal in self.goals.iter_mut().filter(|goal| goal.result.is_none() && is_meant(goal)) {
            goal.status = status::CANCELING;
            goals_canceling.push(goal.info);
        }
        CancelGoalResponse { return_code, goals_canceling }
    }

    /// Returns the state of a goal.
    pub(super) fn state(&mut self, goal_id: Uuid) -> i8 {
        self.find(goal_id).map_or(status::UNKNOWN, |goal| goal.status)
    }

    /// Returns the result of a goal, or keeps the responder until there is one. Beyond a limit, the one that has waited
    /// longest gets no response.
    pub(super) fn result(&mut self, goal_id: Uuid, now: Instant, responder: Responder) -> Waiting {
        self.forget_old(now);
        let Some(goal) = self.find(goal_id) else { return Waiting::Unknown(responder) };
        if let Some((result, _)) = &goal.result {
            return Waiting::No(responder, result.clone());
        }
        if goal.waiting.len() == MAX_WAITING {
            goal.waiting.remove(0);
        }
        goal.waiting.push(responder);
        Waiting::Until
    }

    /// Notes the result of a goal. Returns who waits for it.
    pub(super) fn finish(
        &mut self,
        goal_id: Uuid,
        status: i8,
        result: Vec<u8>,
        now: Instant,
    ) -> Vec<Responder> {
        let Some(goal) = self.find(goal_id) else { return Vec::new() };
        goal.status = status;
        goal.result = Some((result, now));
        std::mem::take(&mut goal.waiting)
    }

    /// Returns the states of all goals.
    pub(super) fn statuses(&mut self, now: Instant) -> Vec<GoalStatus> {
        self.forget_old(now);
        let status = |goal: &Goal| GoalStatus { goal_info: goal.info, status: goal.status };
        self.goals.iter().map(status).collect()
    }

    fn forget_old(&mut self, now: Instant) {
        let is_old = |(_, ended): &(Vec<u8>, Instant)| now.duration_since(*ended) > RESULT_TIMEOUT;
        self.goals.retain(|goal| !goal.result.as_ref().is_some_and(is_old));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(number: u8) -> GoalInfo {
        let stamp = Time { sec: number.into(), nanosec: 0 };
        GoalInfo { goal_id: Uuid { uuid: [number; 16] }, stamp }
    }

    /// Goals with these numbers; all but the last have ended.
    fn goals(numbers: std::ops::RangeInclusive<u8>) -> Goals {
        let mut goals = Goals::default();
        for number in numbers.clone() {
            goals.reserve(info(number).goal_id).unwrap();
            goals.begin(info(number));
            if number != *numbers.end() {
                goals.finish(info(number).goal_id, status::SUCCEEDED, vec![number], Instant::now());
            }
        }
        goals
    }

    #[test]
    fn one_goal_at_a_time_is_active() {
        let mut goals = goals(1..=2);
        let refused = goals.reserve(info(3).goal_id).unwrap_err();
        assert!(refused.contains("another goal is active"), "{refused}");
        assert!(goals.reserve(info(1).goal_id).unwrap_err().contains("earlier goal"));
        goals.finish(info(2).goal_id, status::CANCELED, vec![2], Instant::now());
        goals.reserve(info(3).goal_id).unwrap();
        assert!(goals.reserve(info(4).goal_id).is_err(), "one is being checked");
        goals.release();
        goals.reserve(info(4).goal_id).unwrap();
        goals.close();
        goals.release();
        assert!(goals.reserve(info(5).goal_id).unwrap_err().contains("shutting down"));
    }

    #[test]
    fn goals_are_cancelled_by_identity_and_by_time() {
        let code = |wanted: GoalInfo| {
            let response = goals(1..=3).cancel(wanted);
            (response.return_code, response.goals_canceling.len())
        };
        let (none, early, late) = (Uuid::default(), info(2).stamp, info(9).stamp);
        let any = Time::default();
        assert_eq!(code(GoalInfo { goal_id: none, stamp: any }), (cancel::NONE, 1));
        assert_eq!(code(GoalInfo { goal_id: none, stamp: early }), (cancel::NONE, 0));
        assert_eq!(code(GoalInfo { goal_id: none, stamp: late }), (cancel::NONE, 1));
        assert_eq!(code(GoalInfo { goal_id: info(3).goal_id, stamp: any }), (cancel::NONE, 1));
        assert_eq!(
            code(GoalInfo { goal_id: info(1).goal_id, stamp: any }).0,
            cancel::GOAL_TERMINATED
        );
        assert_eq!(
            code(GoalInfo { goal_id: info(7).goal_id, stamp: any }).0,
            cancel::UNKNOWN_GOAL_ID
        );
        let mut goals = goals(1..=3);
        goals.cancel(info(3));
        let states = [1, 3].map(|number| goals.state(info(number).goal_id));
        assert_eq!(states, [status::SUCCEEDED, status::CANCELING]);
    }

    #[test]
    fn results_are_kept_for_their_time_and_not_without_bound() {
        let mut goals = goals(1..=2);
        let now = Instant::now();
        let ask = |goals: &mut Goals, number, now| {
            let responder = Responder::new(|_| {});
            match goals.result(info(number).goal_id, now, responder) {
                Waiting::Until => "waits".to_owned(),
                Waiting::No(_, result) => format!("{result:?}"),
                Waiting::Unknown(_) => "unknown".to_owned(),
            }
        };
        assert_eq!(ask(&mut goals, 1, now), "[1]");
        assert_eq!(ask(&mut goals, 2, now), "waits");
        assert_eq!(ask(&mut goals, 3, now), "unknown");
        for _ in 0..MAX_WAITING + 9 {
            ask(&mut goals, 2, now);
        }
        assert_eq!(goals.find(info(2).goal_id).unwrap().waiting.len(), MAX_WAITING);
        let later = now + RESULT_TIMEOUT + Duration::from_mins(1);
        assert_eq!(ask(&mut goals, 1, later), "unknown");
        assert_eq!(goals.statuses(later).len(), 1, "an active goal stays");
        let many = self::goals(1..=MAX_KEPT as u8 + 9);
        assert_eq!(many.goals.len(), MAX_KEPT);
    }
}
