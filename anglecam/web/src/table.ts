// The index of a batch: sorted by any column, filtered by words and by status.

export function sortable(table: HTMLTableElement): void {
  const body = table.tBodies[0]!;
  table.querySelectorAll<HTMLTableCellElement>("thead th").forEach((head, column) => {
    const button = head.querySelector("button");
    button?.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      table.querySelectorAll("th[aria-sort]").forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...body.rows].sort((a, b) => compare(key(a, column), key(b, column), down));
      body.append(...rows);
    });
  });
}

export function filterable(table: HTMLTableElement, words: HTMLInputElement, status: HTMLSelectElement, count: HTMLElement): void {
  const rows = [...table.tBodies[0]!.rows];
  const apply = () => {
    const wanted = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const text = (row.textContent ?? "").toLowerCase();
      const fits = wanted.every((word) => text.includes(word));
      row.hidden = !(fits && (status.value === "" || row.dataset["status"] === status.value));
      shown += row.hidden ? 0 : 1;
    }
    count.textContent = `${shown} of ${rows.length} clips`;
  };
  words.addEventListener("input", apply);
  status.addEventListener("change", apply);
  apply();
}

function key(row: HTMLTableRowElement, column: number): string {
  const cell = row.cells[column]!;
  return cell.dataset["key"] ?? cell.textContent ?? "";
}

/** Numbers by size, words by letters; what is empty is last in both directions. */
function compare(a: string, b: string, down: boolean): number {
  if (a === "" || b === "") return a === b ? 0 : a === "" ? 1 : -1;
  const difference = Number(a) - Number(b);
  const order = Number.isNaN(difference) ? a.localeCompare(b, "en", { numeric: true }) : difference;
  return down ? -order : order;
}
