//! The channel that `channel: auto` stands for: counted, logged and reported.

use crate::{
    node::statistics::ChosenChannels,
    scanner::{auto_channel::ChannelChoice, params::Channel},
};

/// The choice of the open scan.
#[derive(Debug, Default)]
pub(super) struct ChosenChannel {
    choice: Option<ChannelChoice>,
    /// The last choice in the log: scan after scan usually has the same one.
    logged: Option<Channel>,
}

impl ChosenChannel {
    /// Notes the choice of a measured frame. The first frames of a scan may have none. Logs every new choice.
    pub(super) fn note_frame(
        &mut self,
        choice: Option<ChannelChoice>,
        counts: &mut ChosenChannels,
    ) {
        self.choice = choice;
        let Some(choice) = choice else { return };
        counts.count(choice.channel);
        if self.logged.replace(choice.channel) != Some(choice.channel) {
            tracing::info!("{}", in_a_sentence(&choice));
        }
    }

    /// The name of the channel.
    pub(super) fn name(&self) -> Option<&'static str> {
        self.choice.map(|choice| choice.channel.name())
    }
}

/// States a choice of the channel and its reason.
fn in_a_sentence(choice: &ChannelChoice) -> String {
    let &ChannelChoice { channel, clipped, brightest, brightest_clipped } = choice;
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let name = channel.name();
    if channel == brightest {
        return format!(
            "channel auto: measuring {name}, in which the line has the most contrast ({} of the cross-sections clipped)",
            percent(clipped)
        );
    }
    format!(
        "channel auto: measuring {name}: it clips the line in {} of the cross-sections, {} in {}",
        percent(clipped),
        brightest.name(),
        percent(brightest_clipped)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_without_a_choice_yet_does_not_report_the_last_one() {
        let choice = |channel| {
            Some(ChannelChoice {
                channel,
                clipped: 0.0,
                brightest: channel,
                brightest_clipped: 0.0,
            })
        };
        let (mut chosen, mut counts) = (ChosenChannel::default(), ChosenChannels::default());
        let mut name_after = |choice| {
            chosen.note_frame(choice, &mut counts);
            chosen.name()
        };
        assert_eq!(name_after(None), None);
        assert_eq!(name_after(choice(Channel::Green)), Some("green"));
        assert_eq!(name_after(None), None, "the first frame of the next scan");
        assert_eq!(name_after(choice(Channel::Red)), Some("red"));
    }
}
