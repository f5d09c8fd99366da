//! Lists parameter names by prefix, as rclcpp does.

use crate::msg::rcl_interfaces::{ListParametersResult, Text};

/// Separator between the levels of a name.
const SEPARATOR: char = '.';

/// Lists the names below one of the prefixes, or all names without prefixes, up to `depth` levels deep (0: unlimited).
/// Returns the names in order, with their prefixes.
pub(super) fn list<'a>(
    names: impl Iterator<Item = &'a str>,
    prefixes: &[Text<'_>],
    depth: u64,
) -> ListParametersResult<'a> {
    let is_shallow = |rest: &str| depth == 0 || (rest.matches(SEPARATOR).count() as u64) < depth;
    let is_wanted = |name: &&str| {
        let below = |Text(prefix): &Text<'_>| match name.strip_prefix(&**prefix) {
            Some("") => true,
            Some(rest) => rest.strip_prefix(SEPARATOR).is_some_and(is_shallow),
            None => false,
        };
        if prefixes.is_empty() { is_shallow(name) } else { prefixes.iter().any(below) }
    };
    let mut result = ListParametersResult::default();
    for name in names.filter(is_wanted) {
        result.names.push(name.into());
        if let Some((prefix, _)) = name.rsplit_once(SEPARATOR)
            && !result.prefixes.iter().any(|Text(earlier)| earlier == prefix)
        {
            result.prefixes.push(prefix.into());
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 5] = ["a", "b.c", "b.d.e", "b.d.f", "bc.d"];

    fn listed(prefixes: &[&'static str], depth: u64) -> (Vec<String>, Vec<String>) {
        let prefixes: Vec<_> = prefixes.iter().map(|prefix| Text::from(*prefix)).collect();
        let result = list(NAMES.into_iter(), &prefixes, depth);
        let texts = |texts: Vec<Text<'_>>| texts.into_iter().map(|text| text.0.into()).collect();
        (texts(result.names), texts(result.prefixes))
    }

    #[test]
    fn prefixes_end_at_dots_and_depth_counts_below_them() {
        assert_eq!(listed(&[], 0).0, NAMES);
        assert_eq!(listed(&[], 0).1, ["b", "b.d", "bc"]);
        assert_eq!(listed(&[], 1).0, ["a"]);
        assert_eq!(listed(&[], 2).0, ["a", "b.c", "bc.d"]);
        assert_eq!(listed(&["b"], 0).0, ["b.c", "b.d.e", "b.d.f"]);
        assert_eq!(listed(&["b"], 1), (vec!["b.c".into()], vec!["b".into()]));
        assert_eq!(listed(&["a", "b.d"], 1).0, ["a", "b.d.e", "b.d.f"]);
        assert_eq!(listed(&["b."], 0).0, Vec::<String>::new());
    }
}
