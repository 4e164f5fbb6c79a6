//! What any page must hold; for the tests of those who make one.

/// What is wrong with a page: a tag that is not closed in its order, something that it asks for from outside, a value
/// that is no number, or more than a megabyte.
///
/// # Errors
/// The first fault, as a sentence.
pub fn sound(page: &str) -> Result<(), String> {
    let mut open = Vec::new();
    for tag in page.split('<').skip(1) {
        let (tag, _) = tag
            .split_once('>')
            .ok_or_else(|| format!("a tag does not end: {:.40}", tag))?;
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name) {
                return Err(format!("</{name}> closes what was not opened last"));
            }
        } else if !tag.ends_with('/') && !tag.starts_with('!') {
            open.push(tag.split_whitespace().next().unwrap_or_default());
        }
    }
    if !open.is_empty() {
        return Err(format!("left open: {open:?}"));
    }
    let outside = page.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for word in ["http", "src=", "href=", "url(", "@import", "<script"] {
        if outside.contains(word) {
            return Err(format!("the page reaches out: {word}"));
        }
    }
    for word in ["NaN", "nan,", "inf,", "Infinity"] {
        if page.contains(word) {
            return Err(format!("not a number: {word}"));
        }
    }
    if page.len() > 1_000_000 {
        return Err(format!(
            "{} bytes are more than a page should have",
            page.len()
        ));
    }
    Ok(())
}
