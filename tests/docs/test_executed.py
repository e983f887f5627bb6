"""Pages that are run when the site is built show what their code prints and draws."""

import json
import sys

import pytest

from docs.executed import console, notebook

CODE = (
    "import pandas as pd; from matplotlib.figure import Figure; print('printed')",
    "pd.DataFrame({'a': range(30)})",
    "Figure()",
    "import sautereau as st; st.Rig('paper')",
    "x = 1",
)


def test_a_notebook_shows_texts_tables_and_pictures(tmp_path):
    cells = [{"cell_type": "markdown", "source": ["# Title"]}]
    cells += [{"cell_type": "code", "source": [code]} for code in CODE]
    path = tmp_path / "book.ipynb"
    path.write_text(json.dumps({"cells": cells}))
    page, pictures = notebook(path)
    assert page.startswith("# Title")
    assert "```text\nprinted\n```" in page
    assert "11  11\n... 18 more rows" in page
    assert "](book/1.png)" in page
    assert "<Rig paper>" in page
    assert page.rstrip().endswith("x = 1\n```")
    assert [name for name, data in pictures.items() if data.startswith(b"\x89PNG")] == [
        "book/1.png"
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="the pages are written for bash")
def test_a_page_shows_the_outputs_of_its_commands(tmp_path):
    path = tmp_path / "page.md"
    text = """# Page

```console
$ echo one; mkdir folder
...
$ printf drawn > folder/a.png
```

<!-- picture: folder/a.png A picture -->

```python
kept
```

```console
$ ls folder
old
```
"""
    path.write_text(text)
    page, pictures = console(path)
    assert "$ echo one; mkdir folder\none\n$ printf drawn > folder/a.png\n```" in page
    assert "$ ls folder\na.png\n```" in page
    assert "kept" in page
    assert "![A picture](page/a.png)" in page
    assert pictures == {"page/a.png": b"drawn"}
    path.write_text("```console\n$ false\n```\n")
    with pytest.raises(RuntimeError, match="a command has failed"):
        console(path)
