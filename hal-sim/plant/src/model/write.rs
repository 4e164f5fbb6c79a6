//! [`Model`] to `model.toml`.

use super::Model;
use crate::document::table;
use std::fmt::Write;
use toml::{Table, Value};

impl Model {
    /// The model as the text of a `model.toml`: sections in their declared order, lists of tables inline, one line each.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        for (name, section) in [
            ("screw", table(&self.screw)),
            ("nut", table(&self.nut)),
            ("feed", table(&self.feed)),
            ("sensing", table(&self.sensing)),
            ("installation", table(&self.installation)),
        ] {
            write_table(&mut text, &format!("[{name}]"), &section);
        }
        if let Some(measured) = &self.measured {
            write_table(&mut text, "[measured.screw]", &table(&measured.screw));
            write_table(&mut text, "[measured.nut]", &table(&measured.nut));
            if let Some(feed) = &measured.feed {
                write_table(&mut text, "[measured.feed]", &table(feed));
            }
        }
        for effect in &self.effects {
            write_table(&mut text, "[[effects]]", &effect.to_table());
        }
        text
    }
}

fn write_table(text: &mut String, header: &str, table: &Table) {
    if !text.is_empty() {
        text.push('\n');
    }
    // Writing to a string does not fail.
    let _ = writeln!(text, "{header}");
    for (key, value) in table {
        let _ = match value {
            Value::Array(list) if list.is_empty() => Ok(()),
            Value::Array(list) => {
                let items: String = list
                    .iter()
                    .map(|item| format!("    {},\n", plain(item)))
                    .collect();
                writeln!(text, "{key} = [\n{items}]")
            }
            value => writeln!(text, "{key} = {}", number(key, value)),
        };
    }
}

fn plain(item: &Value) -> String {
    match item {
        Value::Table(table) => {
            let pairs: Vec<_> = table
                .iter()
                .map(|(key, value)| format!("{key} = {}", number(key, value)))
                .collect();
            format!("{{ {} }}", pairs.join(", "))
        }
        other => other.to_string(),
    }
}

/// Orders are written as whole numbers where they are: `order = 6`.
fn number(key: &str, value: &Value) -> String {
    match value {
        Value::Float(order) if key == "order" && order.fract() == 0.0 => format!("{order:.0}"),
        Value::Float(small) if *small != 0.0 && small.abs() < 1e-5 => format!("{small:e}"),
        other => other.to_string(),
    }
}
