"use strict";
// Cells with a number sort by it, others by their text; what is unknown stays last.
function key(row, column) {
  const cell = row.cells[column];
  const text = cell.dataset.sort ?? cell.textContent.trim();
  const number = text === "" ? NaN : Number(text.replace("< ", ""));
  return { text, number, unknown: text === "" };
}
function compare(a, b) {
  if (a.unknown || b.unknown) return (a.unknown - b.unknown) * 1e9;
  const both = !Number.isNaN(a.number) && !Number.isNaN(b.number);
  return both ? a.number - b.number : a.text.localeCompare(b.text, undefined, { numeric: true });
}
for (const table of document.querySelectorAll("table.sortable")) {
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    const sort = () => {
      const sign = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      for (const other of headings) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      const body = table.tBodies[0];
      const rows = [...body.rows].map((row) => [key(row, column), row]);
      rows.sort(([a], [b]) => (a.unknown || b.unknown ? 1 : sign) * compare(a, b));
      body.append(...rows.map(([, row]) => row));
    };
    heading.tabIndex = 0;
    heading.addEventListener("click", sort);
    heading.addEventListener("keydown", (event) => { if (event.key === "Enter") sort(); });
  });
}
