"use strict";
document.querySelectorAll(".table").forEach(function (box) {
  const button = document.createElement("button");
  button.className = "csv";
  button.type = "button";
  button.textContent = "Save as CSV";
  button.setAttribute("aria-label", "Save as CSV: " + box.querySelector("caption").textContent);
  button.addEventListener("click", function () {
    const quoted = (cell) => '"' + cell.textContent.replace(/"/g, '""') + '"';
    const lines = Array.from(box.querySelectorAll("tr"), (row) => Array.from(row.cells, quoted).join(","));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([lines.join("\r\n") + "\r\n"], { type: "text/csv" }));
    link.download = "numbers.csv";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  box.after(button);
});
