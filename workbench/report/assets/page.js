"use strict";
document.querySelectorAll(".table").forEach(function (box) {
  const caption = box.querySelector("caption").textContent;
  const button = document.createElement("button");
  button.className = "csv";
  button.type = "button";
  button.textContent = "Save as CSV";
  button.setAttribute("aria-label", "Save as CSV: " + caption);
  function written(cell) {
    const text = "v" in cell.dataset ? cell.dataset.v : cell.textContent;
    return /[",\r\n]/.test(text) ? '"' + text.replace(/"/g, '""') + '"' : text;
  }
  button.addEventListener("click", function () {
    const lines = Array.from(box.querySelectorAll("tr"), (row) => Array.from(row.cells, written).join(","));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([lines.join("\r\n") + "\r\n"], { type: "text/csv" }));
    link.download = (caption.replace(/[^\p{L}\p{N}]+/gu, "-").slice(0, 60) || "numbers") + ".csv";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  box.after(button);
});
