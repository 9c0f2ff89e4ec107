// Makes each heading of a sortable table a button: up, down, and back to the order in which the rows were written.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0], written = [...body.rows], headings = [...table.tHead.rows[0].cells];
  const key = (row, column) => {
    const cell = row.cells[column], number = cell.dataset.key;
    return number === "" ? { kind: 2, value: 0 } // numbers, words, nothing: in either direction
      : number ? { kind: 0, value: Number(number) } : { kind: 1, value: cell.textContent.trim() };
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
