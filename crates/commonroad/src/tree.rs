//! Elements of a document by name, and what is wrong at one of them.

use std::borrow::Cow;

use roxmltree::Node;

use crate::document::{Read, Refusal};
use crate::limits::LARGEST_ID;
use crate::values;

/// An element.
pub type Element<'a> = Node<'a, 'a>;

/// What stands in for reasons that have no words of their own.
const UNKNOWN: &str = "a part of it is missing, empty or of a wrong kind";

/// Access by name. Names are those without a namespace, which the format does not have.
pub trait Tree<'a> {
    /// Whether it is an element of this name.
    fn is(&self, name: &str) -> bool;
    /// Children that are elements.
    fn elements(&self) -> impl Iterator<Item = Element<'a>>;
    /// Children of a name.
    fn all(&self, name: &str) -> impl Iterator<Item = Element<'a>>;
    /// Elements at the end of a path of names, in the order of the document.
    fn path(&self, names: &str) -> Vec<Element<'a>>;
    /// First child of a name.
    fn first(&self, name: &str) -> Option<Element<'a>>;
    /// First child of a name, or a refusal.
    fn need(&self, name: &str) -> Read<Element<'a>>;
    /// Text before the first child; empty if there is none.
    fn words(&self) -> Cow<'a, str>;
    /// Number in the text.
    fn real(&self) -> Read<f64>;
    /// Whole number in the text.
    fn whole(&self) -> Read<i64>;
    /// Number of the first child of a name.
    fn real_of(&self, name: &str) -> Read<f64>;
    /// The text, if it is one of the names; `kind` says what they name.
    fn one_of(&self, names: &[&'static str], kind: &str) -> Read<&'static str>;
    /// A whole number in an attribute.
    fn number(&self, attribute: &str) -> Read<i64>;
    /// Refusal because of this element, in the words of the format.
    fn refused(&self, reason: &str) -> Refusal;
    /// The same where there are no better words.
    fn unreadable(&self) -> Refusal;
    /// The element for messages: its name and id.
    fn named(&self) -> String;
}

impl<'a> Tree<'a> for Element<'a> {
    fn is(&self, name: &str) -> bool {
        self.is_element() && self.tag_name().name() == name && self.tag_name().namespace().is_none()
    }

    fn elements(&self) -> impl Iterator<Item = Element<'a>> {
        self.children().filter(Node::is_element)
    }

    fn all(&self, name: &str) -> impl Iterator<Item = Element<'a>> {
        self.children().filter(move |child| child.is(name))
    }

    fn path(&self, names: &str) -> Vec<Element<'a>> {
        names.split('/').fold(vec![*self], |level, name| {
            level.iter().flat_map(|element| element.all(name).collect::<Vec<_>>()).collect()
        })
    }

    fn first(&self, name: &str) -> Option<Element<'a>> {
        self.children().find(|child| child.is(name))
    }

    fn need(&self, name: &str) -> Read<Element<'a>> {
        self.first(name).ok_or_else(|| self.unreadable())
    }

    fn words(&self) -> Cow<'a, str> {
        // Comments and instructions may divide a text.
        let mut parts = self.children().take_while(|child| !child.is_element()).filter(Node::is_text);
        let first = parts.next().and_then(|part| part.text()).unwrap_or("");
        parts.fold(Cow::Borrowed(first), |text, part| text + part.text().unwrap_or(""))
    }

    fn real(&self) -> Read<f64> {
        let text = self.words();
        let wrong = || {
            if text.is_empty() {
                self.unreadable()
            } else {
                self.refused(&format!("{} is not a number", quoted(&text)))
            }
        };
        values::real(&text).ok_or_else(wrong)
    }

    fn whole(&self) -> Read<i64> {
        let text = self.words();
        let wrong = || {
            if text.is_empty() {
                self.unreadable()
            } else {
                self.refused(&format!("{} is not a whole number", quoted(&text)))
            }
        };
        let number = values::whole(&text).ok_or_else(wrong)?;
        i64::try_from(number).map_err(|_| self.unreadable())
    }

    fn real_of(&self, name: &str) -> Read<f64> {
        self.need(name)?.real()
    }

    fn one_of(&self, names: &[&'static str], kind: &str) -> Read<&'static str> {
        let text = self.words();
        names.iter().find(|name| **name == text.as_ref()).copied().ok_or_else(|| {
            let reason = if text.is_empty() {
                format!("the {kind} is missing")
            } else {
                format!("{} is no {kind}", quoted(&text))
            };
            // The reason names the element itself.
            self.parent_element().as_ref().unwrap_or(self).refused(&reason)
        })
    }

    fn number(&self, attribute: &str) -> Read<i64> {
        let number = self.attribute(attribute).and_then(values::whole).ok_or_else(|| self.unreadable())?;
        i64::try_from(number).ok().filter(|number| *number <= LARGEST_ID).ok_or_else(|| self.unreadable())
    }

    fn refused(&self, reason: &str) -> Refusal {
        let below_root = |element: &Element<'a>| element.parent_element().is_some();
        let mut inner = String::new();
        let mut owner = String::new();
        for element in self.ancestors().filter(|node| node.is_element() && below_root(node)) {
            let name = element.tag_name().name();
            if let Some(id) = element.attribute("id").filter(|id| !id.is_empty()) {
                owner = format!(" of {name} {id}");
                break;
            }
            if inner.is_empty() {
                inner = format!(" at <{name}>");
            }
        }
        if inner.is_empty() {
            owner = owner.replacen(" of ", " at ", 1);
        }
        let advice = if inner.is_empty() && owner.is_empty() { "correct the file" } else { "correct that element" };
        Refusal::Content(format!("cannot be read{inner}{owner} ({reason}); {advice}"))
    }

    fn unreadable(&self) -> Refusal {
        self.refused(UNKNOWN)
    }

    fn named(&self) -> String {
        let name = self.tag_name().name();
        match self.attribute("id") {
            Some(id) if !id.is_empty() => format!("{name} {id}"),
            _ => format!("<{name}>"),
        }
    }
}

/// A text in quotes, as much of it as a message can show.
fn quoted(text: &str) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    format!("'{}'", words.chars().take(100).collect::<String>())
}

/// The id of an element, which has been checked.
pub fn id(element: Element<'_>) -> Read<i64> {
    element.number("id")
}

/// The name of an element as messages show it where it may have a namespace.
pub fn full_name(element: Element<'_>) -> String {
    let name = element.tag_name();
    name.namespace().map_or_else(|| name.name().to_string(), |space| format!("{{{space}}}{}", name.name()))
}
