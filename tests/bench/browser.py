"""Pages in a real browser, and what of a page would trouble a reader."""

OVERLAPS = """() => {
  const leaves = [...document.querySelectorAll("body *")].filter((e) =>
    !e.closest("title, desc, script, style, option")
    && e.checkVisibility({ visibilityProperty: true })
    && [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()));
  const boxes = leaves.map((e) => [e, e.getBoundingClientRect()]).filter(([e, r]) =>
    r.width > 1 && r.height > 1);
  const overlaps = [];
  boxes.forEach(([e, r], i) => boxes.slice(i + 1).forEach(([f, q]) => {
    const wide = Math.min(r.right, q.right) - Math.max(r.left, q.left);
    const high = Math.min(r.bottom, q.bottom) - Math.max(r.top, q.top);
    if (wide > 2 && high > 3 && !e.contains(f) && !f.contains(e))
      overlaps.push([e.textContent, f.textContent, wide, high]);
  }));
  const cut = boxes.filter(([e, r]) => {
    const frame = e.closest(".plot, .picture svg")?.getBoundingClientRect();
    return frame && (r.left < frame.left - 2 || r.right > frame.right + 2);
  }).map(([e]) => e.textContent);
  return { texts: boxes.length, overlaps, cut, wide: document.documentElement.scrollWidth };
}"""
"""Boxes of texts that overlap by more than 2 by 3 px, their number, texts that leave their picture
by more than 2 px, and the page's width [px]."""
WIDE = "* { letter-spacing: 0.12em !important }"
MONOSPACED = "* { font-family: monospace !important }"
"""Styles of a reader whose fonts are wide, whichever are installed."""


def observed(browser, **options):
    """Open an empty page; return it, its errors and dialogs to come, and its requests to come."""
    page = browser.new_page(viewport={"width": 1200, "height": 900}, **options)
    faults, requests = [], []
    page.on("console", lambda message: faults.append(message.text))
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("dialog", lambda dialog: (faults.append(dialog.message), dialog.dismiss()))
    page.on("request", lambda request: requests.append(request))
    return page, faults, requests
