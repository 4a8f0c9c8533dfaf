//! What is noticed while a sketch is read, told once however many lines it concerns.

/// Sentences about the whole file, and peculiarities that lines share.
#[derive(Debug, Default)]
pub(super) struct Notes {
    notes: Vec<Note>,
}

#[derive(Debug)]
enum Note {
    Sentence(String),
    Shared { what: String, names: Vec<String> },
}

impl Notes {
    /// A whole sentence.
    pub(super) fn say(&mut self, sentence: impl Into<String>) {
        self.notes.push(Note::Sentence(sentence.into()));
    }

    /// That the line called `name` is one of those "`what`".
    pub(super) fn line(&mut self, what: &str, name: &str) {
        for note in &mut self.notes {
            if let Note::Shared { what: known, names } = note
                && known == what
            {
                // A line that is noted again and again is noted one time after the other.
                if names.last().is_none_or(|last| last != name) {
                    names.push(name.to_owned());
                }
                return;
            }
        }
        self.notes.push(Note::Shared { what: what.to_owned(), names: vec![name.to_owned()] });
    }

    /// Everything in whole sentences, in the order in which it was noticed first.
    pub(super) fn into_sentences(self) -> Vec<String> {
        let sentence = |note| match note {
            Note::Sentence(text) => text,
            Note::Shared { what, names } => shared(&what, &names),
        };
        self.notes.into_iter().map(sentence).collect()
    }
}

/// One sentence for all lines that share a peculiarity, naming the first few.
fn shared(what: &str, names: &[String]) -> String {
    const SHOWN: usize = 5;
    let listed = names[..names.len().min(SHOWN)].join("; ");
    let more =
        if names.len() > SHOWN { format!("; and {} more", names.len() - SHOWN) } else { String::new() };
    let count = if names.len() == 1 { "1 line".to_owned() } else { format!("{} lines", names.len()) };
    format!("{count} {what} ({listed}{more}).")
}
