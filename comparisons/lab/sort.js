// Makes each heading of a sortable table a button: up, down, and back to the order in which the rows were written.
const NUMBER = /^([<>≤≥~≈±=]?)\s*([-−+]?(?:\d[\d,]*\.?\d*(?:[eE][-−+]?\d+)?|\.\d+|inf(?![A-Za-z])|∞))[²³]?\s*(%|[µμ]?[A-Za-z]+)?(?![\w.:-]*\w)/;
const UNITS = { "%": 1e-2, "µs": 1e-6, "μs": 1e-6, ms: 1e-3, min: 60, h: 3600, KiB: 2 ** 10, MiB: 2 ** 20, GiB: 2 ** 30 };
for (const cell of document.querySelectorAll("td")) {
  cell.classList.toggle("failed", /^(failed|fails|lies|error|timeout|memory|crashed)$/i.test(cell.textContent.trim()));
}
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0], written = [...body.rows], headings = [...table.tHead.rows[0].cells];
  const key = (row, column) => { // numbers, words, nothing: in either direction
    const text = row.cells[column].textContent.trim(), found = NUMBER.exec(text);
    if (/^(|-|−|–|—|n\/a|nan|none)$/i.test(text)) return { kind: 2, value: 0 };
    if (!found) return { kind: 1, value: text };
    const number = Number(found[2].replace("−", "-").replaceAll(",", "").replace(/∞|inf/, "Infinity"));
    const beside = { "<": -1e-9, ">": 1e-9 }[found[1]] ?? 0; // "< 1e-9" is just below 1e-9
    return { kind: 0, value: number * (UNITS[found[3]] ?? 1) * (1 + (number === Infinity ? 0 : beside)) };
  };
  const compare = (a, b) => (a.kind === 1 && a.value.localeCompare(b.value, "en", { numeric: true }))
    || (a.value > b.value) - (a.value < b.value);
  const sorted = (column, sign) => written
    .map((row) => ({ row, ...key(row, column) }))
    .sort((a, b) => a.kind - b.kind || sign * compare(a, b))
    .map((entry) => entry.row);
  headings.forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const next = { ascending: "descending", descending: "none" }[heading.getAttribute("aria-sort")] ?? "ascending";
      headings.forEach((other) => other.removeAttribute("aria-sort"));
      if (next !== "none") heading.setAttribute("aria-sort", next);
      body.append(...(next === "none" ? written : sorted(column, next === "ascending" ? 1 : -1)));
    });
  });
}
