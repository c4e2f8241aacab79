// A button on every block of code that copies it, without the prompts of commands.
"use strict";
document.addEventListener("DOMContentLoaded", () => {
  if (!navigator.clipboard) return;
  for (const block of document.querySelectorAll("div.highlight")) {
    const button = document.createElement("button");
    button.className = "copy-code";
    button.type = "button";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      const lines = block.querySelector("pre").textContent.split("\n");
      const typed = lines.filter((line) => /^(\$|>>>|\.\.\.) /.test(line));
      const text = typed.length ? typed.map((line) => line.replace(/^(\$|>>>|\.\.\.) /, "")) : lines;
      await navigator.clipboard.writeText(text.join("\n"));
      button.textContent = "Copied";
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    });
    block.append(button);
  }
});
