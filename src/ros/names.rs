//! Names as rcl resolves them: relative, `~/private` and `/absolute`, then the first matching remap rule.

use ros2args::{RemapRule, Ros2ArgsError, names};
use thiserror::Error;

/// Errors in names and remap rules.
#[derive(Debug, Error)]
pub enum NameError {
    /// A name with characters or slashes that ROS does not allow.
    #[error("{0}")]
    Invalid(#[from] Ros2ArgsError),
    /// A substitution, which is not supported.
    #[error(
        "name {0:?} contains a substitution in braces, which is not supported: write the full name"
    )]
    Substitution(String),
}

/// A node's resolved identity and the remap rules of its topics.
#[derive(Clone, Debug)]
pub struct NodeNames {
    name: String,
    namespace: String,
    rules: Vec<RemapRule>,
}

impl NodeNames {
    /// Applies the `__node` and `__ns` rules to the node `name`. As in rcl, a rule with a node prefix is matched with
    /// the name before renaming here, and with the final name in [`resolve`](Self::resolve).
    ///
    /// # Errors
    /// A node name, namespace or topic name in a rule that ROS does not allow.
    pub fn new(name: &str, rules: &[RemapRule]) -> Result<Self, NameError> {
        let renamed = |keys: &[&str]| {
            rules
                .iter()
                .find(|rule| rule.applies_to_node(name) && keys.contains(&rule.from.as_str()))
                .map(|rule| rule.to.clone())
        };
        // `__name` is the older spelling of `__node`; rcl accepts both.
        let final_name = renamed(&["__node", "__name"]).unwrap_or_else(|| name.to_owned());
        names::validate_node_name(&final_name)?;
        let mut namespace = renamed(&["__ns"]).unwrap_or_else(|| "/".to_owned());
        if !namespace.starts_with('/') {
            namespace.insert(0, '/');
        }
        names::validate_namespace(&namespace)?;

        let rules: Vec<_> =
            rules.iter().filter(|rule| !rule.from.starts_with("__")).cloned().collect();
        let names = Self { name: final_name, namespace, rules };
        for rule in &names.rules {
            names.expand(topic_of(rule))?;
            names.expand(&rule.to)?;
        }
        Ok(names)
    }

    /// Returns the node's name without its namespace.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns the node's namespace, `/` for none.
    pub(crate) fn namespace(&self) -> &str {
        &self.namespace
    }

    /// Returns namespace and name, such as `/cell/laser_profiler`.
    pub fn fully_qualified(&self) -> String {
        names::build_node_fqn(&self.namespace, &self.name)
    }

    /// Returns the name of the node's logger: namespace and name with dots, such as `cell.laser_profiler`.
    pub(crate) fn logger(&self) -> String {
        self.fully_qualified().trim_start_matches('/').replace('/', ".")
    }

    /// Returns the absolute name of a topic after remapping; the first matching rule applies.
    ///
    /// # Errors
    /// A name that ROS does not allow.
    pub fn resolve(&self, topic: &str) -> Result<String, NameError> {
        self.remapped(topic)?.map_or_else(|| self.expand(topic), Ok)
    }

    /// Returns the absolute name that a rule assigns to a topic; `None` if no rule matches.
    ///
    /// # Errors
    /// A name that ROS does not allow.
    pub(crate) fn remapped(&self, topic: &str) -> Result<Option<String>, NameError> {
        let expanded = self.expand(topic)?;
        for rule in &self.rules {
            if rule.applies_to_node(&self.name) && self.expand(topic_of(rule))? == expanded {
                return self.expand(&rule.to).map(Some);
            }
        }
        Ok(None)
    }

    fn expand(&self, topic: &str) -> Result<String, NameError> {
        if topic.contains(['{', '}']) {
            return Err(NameError::Substitution(topic.to_owned()));
        }
        Ok(names::expand_topic_name(&self.namespace, &self.name, topic)?)
    }
}

/// Returns the topic that a rule matches, without the prefix `rostopic://` that rcl allows.
fn topic_of(rule: &RemapRule) -> &str {
    rule.from.strip_prefix("rostopic://").unwrap_or(&rule.from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(rules: &[&str]) -> Result<NodeNames, NameError> {
        let mut arguments = vec!["--ros-args".to_owned()];
        for rule in rules {
            arguments.extend(["-r".to_owned(), (*rule).to_owned()]);
        }
        NodeNames::new(
            "laser_profiler",
            &ros2args::parse_ros2_args(&arguments).unwrap().0.remap_rules,
        )
    }

    fn resolved(rules: &[&str], topic: &str) -> String {
        names(rules).unwrap().resolve(topic).unwrap()
    }

    #[test]
    fn names_are_expanded_before_they_are_compared() {
        assert_eq!(resolved(&[], "image_raw"), "/image_raw");
        assert_eq!(resolved(&[], "~/points"), "/laser_profiler/points");
        assert_eq!(resolved(&[], "/diagnostics"), "/diagnostics");
        assert_eq!(resolved(&["__ns:=/cell"], "image_raw"), "/cell/image_raw");
        assert_eq!(resolved(&["__ns:=cell", "__node:=top"], "~/points"), "/cell/top/points");
        assert_eq!(resolved(&["/cell/image_raw:=/a", "__ns:=/cell"], "image_raw"), "/a");
        assert_eq!(
            resolved(&["image_raw:=left/image", "__ns:=/cell"], "image_raw"),
            "/cell/left/image"
        );
        assert_eq!(
            resolved(&["/laser_profiler/points:=~/cloud"], "~/points"),
            "/laser_profiler/cloud"
        );
    }

    #[test]
    fn the_logger_is_named_after_the_node() {
        assert_eq!(names(&[]).unwrap().logger(), "laser_profiler");
        assert_eq!(names(&["__ns:=/a/b", "__node:=top"]).unwrap().logger(), "a.b.top");
    }

    #[test]
    fn the_first_matching_rule_wins() {
        assert_eq!(resolved(&["image_raw:=/a", "image_raw:=/b"], "image_raw"), "/a");
        assert_eq!(resolved(&["__node:=a", "__node:=b"], "~/x"), "/a/x");
    }

    #[test]
    fn a_node_prefix_selects_one_node() {
        assert_eq!(resolved(&["other:image_raw:=/a", "image_raw:=/b"], "image_raw"), "/b");
        assert_eq!(resolved(&["laser_profiler:image_raw:=/a"], "image_raw"), "/a");
        assert_eq!(
            resolved(&["laser_profiler:__node:=top", "top:image_raw:=/a"], "image_raw"),
            "/a"
        );
    }

    #[test]
    fn names_that_ros_forbids_are_rejected() {
        for rule in ["__node:=a/b", "__ns:=/a//b", "image_raw:=/9a", "a b:=/c", "x:={node}/a"] {
            assert!(names(&[rule]).is_err(), "{rule}");
        }
    }
}
