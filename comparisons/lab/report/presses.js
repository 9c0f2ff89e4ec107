// What a table says when each of its buttons is pressed three times, one column after the other.
(table) => {
  const headings = [...table.tHead.rows[0].cells], buttons = [...table.tHead.querySelectorAll("th button")];
  const state = () => ({
    ways: headings.map((heading) => heading.getAttribute("aria-sort")),
    rows: [...table.tBodies[0].rows].map((row) => [...row.cells].map((cell) => cell.textContent)),
  });
  const pressed = (button) => [0, 1, 2].map(() => {
    button.click();
    return state();
  });
  return { columns: headings.length, written: state().rows, states: buttons.map(pressed) };
}
