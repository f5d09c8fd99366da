//! A YAML or JSON text as a tree with line numbers, before anything is known about its keys.

use granit_parser::{Event, Marker, Parser, ScanError};

/// Deepest nesting of a calibration file.
const MAX_DEPTH: usize = 32;

/// A value and where it stands: the place of its key, if it has one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    /// Line of the text, from 1.
    pub(super) line: usize,
    /// Column of the text, from 1.
    pub(super) column: usize,
    pub(super) value: Value,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// Keys in the order of the text, possibly repeated.
    Map(Vec<(String, Node)>),
    List(Vec<Node>),
    /// A number or a text.
    Scalar(String),
    /// A reference to another part of the text.
    Alias,
}

impl Node {
    /// Returns the entries; none if this is no mapping.
    pub(super) fn entries(&self) -> &[(String, Self)] {
        match &self.value {
            Value::Map(entries) => entries,
            _ => &[],
        }
    }

    pub(super) fn get(&self, key: &str) -> Option<&Self> {
        self.entries().iter().find_map(|(name, node)| (name == key).then_some(node))
    }

    pub(super) fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Scalar(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the number; `None` for anything else, and for NaN and infinities.
    pub(super) fn number(&self) -> Option<f64> {
        self.text()?.parse().ok().filter(|number: &f64| number.is_finite())
    }

    /// Returns the numbers of a list, nested by rows or not.
    pub(super) fn numbers(&self) -> Option<Vec<f64>> {
        let Value::List(items) = &self.value else { return None };
        let mut numbers = Vec::with_capacity(items.len());
        for item in items {
            match &item.value {
                Value::List(_) => numbers.extend(item.numbers()?),
                _ => numbers.push(item.number()?),
            }
        }
        Some(numbers)
    }
}

/// Returns the documents of a text, without empty ones.
///
/// # Errors
/// The text is not YAML; line, from 1, and reason.
pub(super) fn documents(text: &str) -> Result<Vec<Node>, (usize, String)> {
    let mut builder = Builder::default();
    for event in Parser::new_from_str(text) {
        let (event, span) =
            event.map_err(|error: ScanError| (error.marker().line(), error.info().clone()))?;
        builder.add(event, span.start)?;
    }
    Ok(builder.documents)
}

#[derive(Default)]
struct Builder {
    documents: Vec<Node>,
    /// Collections that have begun and not ended, each with the key that waits for its value.
    open: Vec<(Node, Option<Node>)>,
}

impl Builder {
    fn add(&mut self, event: Event<'_>, at: Marker) -> Result<(), (usize, String)> {
        let (line, column) = (at.line(), at.col() + 1);
        let begin = match event {
            Event::Scalar(text, ..) => {
                self.put(Node { line, column, value: Value::Scalar(text.into_owned()) });
                return Ok(());
            }
            Event::Alias(_) | Event::UnresolvedAlias(_) => {
                self.put(Node { line, column, value: Value::Alias });
                return Ok(());
            }
            Event::SequenceEnd | Event::MappingEnd => {
                if let Some((node, _)) = self.open.pop() {
                    self.put(node);
                }
                return Ok(());
            }
            Event::SequenceStart(..) => Value::List(Vec::new()),
            Event::MappingStart(..) => Value::Map(Vec::new()),
            _ => return Ok(()),
        };
        if self.open.len() == MAX_DEPTH {
            return Err((line, format!("nested more than {MAX_DEPTH} levels deep")));
        }
        self.open.push((Node { line, column, value: begin }, None));
        Ok(())
    }

    fn put(&mut self, node: Node) {
        match self.open.last_mut() {
            Some((Node { value: Value::List(items), .. }, _)) => items.push(node),
            Some((Node { value: Value::Map(entries), .. }, key)) => match key.take() {
                Some(Node { line, column, value }) => {
                    let name = if let Value::Scalar(name) = value { name } else { String::new() };
                    entries.push((name, Node { line, column, ..node }));
                }
                None => *key = Some(node),
            },
            _ if matches!(node.text(), Some("" | "~")) => {}
            _ => self.documents.push(node),
        }
    }
}
