// What can be measured of a page at its present width, as plain data: the sentences are made in browser.py.
() => {
  const width = document.documentElement.clientWidth;
  const shown = (element) => element.checkVisibility({ opacityProperty: true, visibilityProperty: true });
  const named = (element) => {
    const place = element.closest("[id]")?.id ?? "", words = (element.textContent ?? "").replace(/\s+/g, " ").trim().slice(0, 30);
    return `<${element.localName}>${place && ` in #${place}`}${words && ` "${words}"`}`;
  };
  const scrolls = (element) => ["auto", "scroll"].includes(getComputedStyle(element).overflowX);
  const box = (element) => {
    for (let outer = element.parentElement; outer; outer = outer.parentElement) if (scrolls(outer)) return outer;
    return null;
  };
  const outside = (element) => {
    const inner = element.getBoundingClientRect(), outer = box(element);
    if (!outer) return inner.left < -1 || inner.right > width + 1;
    const edge = outer.getBoundingClientRect();
    const left = edge.left + outer.clientLeft - outer.scrollLeft;
    return inner.left < left - 1 || inner.right > left + outer.scrollWidth + 1;
  };
  const letters = (element) => { // height of the letters as they are drawn, scaled pictures included
    const size = parseFloat(getComputedStyle(element).fontSize), drawn = element.getScreenCTM?.();
    return drawn ? size * Math.sqrt(Math.abs(drawn.a * drawn.d - drawn.b * drawn.c)) : size;
  };
  const says = (element) => [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  const silent = "script, style, title, head *";
  const texts = [...document.querySelectorAll("body *")]
    .filter((element) => says(element) && !element.matches(silent) && shown(element))
    .map((element) => ({ name: named(element), drawn: Boolean(element.closest("svg")), letters: letters(element) }));
  const figures = [...document.querySelectorAll("figure")].map((figure) => {
    const content = figure.querySelector("svg, img, canvas, table");
    const area = (content ?? figure).getBoundingClientRect();
    const drawn = content?.localName === "svg" ? content.getBBox() : area;
    const image = content?.localName === "img" ? content.complete && content.naturalWidth > 0 : true;
    const cut = content?.localName === "svg" ? [...content.querySelectorAll("text, tspan")].filter((text) => {
      const place = text.getBoundingClientRect(); // a line's height, more than its letters'
      return says(text) && place.width > 0 && (place.left < area.left - 3 || place.right > area.right + 3
        || place.top < area.top - 3 || place.bottom > area.bottom + 3);
    }).map(named) : [];
    return {
      name: figure.id || figure.getAttribute("aria-label") || named(figure),
      visible: shown(figure) && (!content || shown(content)) && area.width > 1 && area.height > 1,
      drawn: image && drawn.width > 0 && drawn.height > 0,
      outside: outside(content ?? figure), cut,
    };
  });
  const ids = [...document.querySelectorAll("[id]")].map((element) => element.id);
  return {
    width, scroll: document.documentElement.scrollWidth, figures, texts,
    outside: [...document.querySelectorAll("body *")]
      .filter((element) => !element.closest("svg svg, svg *") && shown(element) && outside(element)).map(named),
    repeated: [...new Set(ids.filter((id, place) => ids.indexOf(id) !== place))],
    dead: [...document.querySelectorAll("a[href^='#']")].map((link) => link.getAttribute("href"))
      .filter((target) => target !== "#" && !document.getElementById(decodeURIComponent(target.slice(1)))),
    language: document.documentElement.lang, title: document.title.trim(),
  };
}
