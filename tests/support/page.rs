//! Tables of `docs` that are made from the code.

use std::{env, fs, path::Path};

/// Compares the text of a page between `<!-- name -->` and `<!-- end of name -->` with `expected`. With
/// `FENESTRA_WRITE_DOCS` set, writes it instead.
pub fn check(page_name: &str, name: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(page_name);
    let page = fs::read_to_string(&path).unwrap();
    let (start, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let (before, rest) = page.split_once(&start).expect("the page has the start");
    let (found, after) = rest.split_once(&end).expect("the page has the end");
    if env::var_os("FENESTRA_WRITE_DOCS").is_some() {
        fs::write(&path, format!("{before}{start}{expected}{end}{after}")).unwrap();
        return;
    }
    assert_eq!(
        found, expected,
        "docs/{page_name} differs from the code at {name}: run `interface`, `passes` and `scene_file` \
         with FENESTRA_WRITE_DOCS=1"
    );
}
