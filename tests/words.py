"""Refuses sentences that hide their subject behind their first words, and sentences that are long.

    python3 tests/words.py

Reads the files that Git knows and whose ending it knows: pages, comments and docstrings, and string literals of Rust on one line. Prints each such
sentence and ends with 1 if there is one. Code, tables, headings and questions are no sentences.
"""

import ast
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HIDDEN = re.compile(r"[\W_]*(?:what|of|those|the same|as)\b(?! (?:far|if|long|many|much|soon|well)\b)", re.I)
# Most words of a sentence.
WORDS = 40
END = re.compile(r"(?<=[.!?])[)\"”'*]*\s+(?=[\W_]*[A-Z0-9]|[*(]*`)")
ITEM = re.compile(r"(?:[-*+>]|\d+\.)\s+")
LITERAL = re.compile(r'"((?:[^"\\]|\\.)*)"')
COMMENT = {".rs": "//[/!]?", ".py": "#:?", ".wgsl": "//", ".c": "//", ".js": r"//|/\*\*|\*", ".toml": "#", "": "#"}


def sentences(text):
    """Sentences of a text in Markdown: of its paragraphs and of the items of its lists."""
    parts, is_code = [""], False
    for line in text.splitlines():
        bare = line.strip()
        if bare.startswith("```"):
            is_code = not is_code
        is_set = line.startswith("    ") and not parts[-1] or re.search(r"\S {3,}\S", bare)
        if not bare or is_code or is_set or bare.startswith(("```", "|", "#", "<", "!")):
            parts.append("")
        elif ITEM.match(bare):
            parts.append(ITEM.sub("", bare, count=1))
        else:
            parts[-1] += " " + bare
    found = [one.strip() for part in parts for one in END.split(part)]
    return [one for one in found if one and not one.rstrip("*_\"'`)").endswith("?")]


def comments(text, mark):
    """Comments, each with the number of its first line; a line that is marked otherwise begins another one."""
    found, before = [], None
    for number, line in enumerate(text.splitlines(), 1):
        said = re.match(rf"\s*({mark})(?: (.*)|$)", line)
        if said and before == (number - 1, said[1]):
            found[-1][1].append(said[2] or "")
        elif said:
            found.append((number, [said[2] or ""]))
        before = said and (number, said[1])
    return [(number, "\n".join(lines).removesuffix("*/")) for number, lines in found]


def docstrings(text):
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            yield getattr(node, "lineno", 1), ast.get_docstring(node) or ""


def literals(text):
    """Strings of Rust that begin like a sentence."""
    for number, line in enumerate(text.splitlines(), 1):
        if not line.lstrip().startswith("//"):
            yield from ((number, said[1]) for said in LITERAL.finditer(line) if re.match("[A-Z][a-z]* ", said[1]))


def texts(name):
    """Texts of a file, each with the number of its first line."""
    ending = Path(name).suffix
    if ending != ".md" and ending not in COMMENT or ending == "" and Path(name).name != "run":
        return []
    text = (ROOT / name).read_text(encoding="utf-8")
    if ending == ".md":
        return [(1, text)]
    more = {".py": docstrings, ".rs": literals}.get(ending, lambda _: [])
    return [*comments(text, COMMENT[ending]), *more(text)]


def is_hidden(sentence):
    return HIDDEN.match(sentence) is not None


planted = "A. Of these one\nis bad. **What** is? As long as. `go` on.\n\n- as bad\n\n| what | of |\n```\nof\n```"
assert [one for one in sentences(planted) if is_hidden(one)] == ["Of these one is bad.", "as bad"]
names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
count, words, faults = 0, 0, []
for name in names:
    for line, text in texts(name):
        for sentence in sentences(text):
            length = len(sentence.split())
            count, words = count + 1, words + length
            if is_hidden(sentence):
                faults.append(f"{name}:{line}: begins with what, of, those, the same or as: {sentence}")
            if length > WORDS:
                faults.append(f"{name}:{line}: {length} words: {sentence}")
print(f"{count} sentences, {words / count:.1f} words each", *faults, sep="\n")
sys.exit(bool(faults))
