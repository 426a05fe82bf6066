//! Whether a drawing says what it shows.

/// What a drawing leaves its reader to guess; nothing when it has a title that stands on it, numbers at its
/// axes, and these words: the names of the axes with their units, and those of the legend. Words that were
/// broken into lines count too.
pub fn lacks(svg: &str, words: &[&str]) -> Vec<String> {
    let written = texts(svg);
    let all = written.join(" ");
    let title = svg.split_once("<title>").and_then(|(_, rest)| rest.split_once("</title>"));
    let title = title.map_or(String::new(), |(title, _)| unescaped(title));
    let mut missing = Vec::new();
    if title.is_empty() || !all.contains(&title) {
        missing.push("a title".to_owned());
    }
    if written.iter().filter(|text| text.parse::<f64>().is_ok()).count() < 2 {
        missing.push("numbers at an axis".to_owned());
    }
    missing.extend(words.iter().filter(|word| !all.contains(**word)).map(|word| format!("`{word}`")));
    missing
}

/// Everything that is written on a drawing, in its order.
fn texts(svg: &str) -> Vec<String> {
    let parts = svg.split("<text").skip(1);
    let content = |part: &&str| part.find('>').map(|end| end + 1);
    parts
        .filter_map(|part| {
            let content = &part[content(&part)?..];
            Some(unescaped(content.split_once("</text>")?.0.trim()))
        })
        .collect()
}

/// As people read it.
fn unescaped(text: &str) -> String {
    let letters = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")];
    letters.into_iter().fold(text.to_owned(), |text, (written, letter)| text.replace(written, letter))
}
