// The page: which runs are shown, and the button that stops the wheel.
"use strict";

const chosen = document.getElementById("run"), beside = document.getElementById("beside"), panes = document.getElementById("panes");
let shown = [];

function show() {
  for (const pane of shown) pane.close();
  shown = [];
  for (const run of [chosen.value, beside.value]) {
    if (!run) continue;
    panes.append(document.getElementById("pane").content.cloneNode(true));
    shown.push(new Pane(panes.lastElementChild, run));
  }
  panes.classList.toggle("two", shown.length > 1);
}

async function runs() {
  const told = await (await ask("api/runs")).json();
  const known = [...chosen.options].map((option) => option.value);
  if (JSON.stringify(known) !== JSON.stringify(told.runs)) {
    const before = chosen.value, newest = !known.length || before === known[0];
    const options = () => told.runs.map((name) => new Option(name, name));
    chosen.replaceChildren(...options());
    const second = beside.value;
    beside.replaceChildren(new Option("none", ""), ...options());
    beside.value = told.runs.includes(second) ? second : "";
    chosen.value = newest ? told.runs[0] || "" : before; // who watches the newest goes on with the next
    if (chosen.value !== before) show();
  }
  document.getElementById("stop").hidden = !(told.stop && token());
}

const sure = document.getElementById("sure"), answer = document.getElementById("sure-answer");
document.getElementById("stop").addEventListener("click", () => { answer.textContent = ""; sure.showModal(); });
document.getElementById("sure-no").addEventListener("click", () => sure.close());
document.getElementById("sure-yes").addEventListener("click", async () => {
  answer.textContent = "zero is being written ...";
  try {
    const told = await (await ask("api/stop", { method: "POST" })).json();
    answer.textContent = told.zero_confirmed ? "The wheel has confirmed zero current." : `NOT confirmed: ${told.error && (told.error.messages || [told.error]).join("; ")}`;
  } catch (error) { answer.textContent = `NOT done: ${error.message}. rw-ekf stop, or cut its power.`; }
});
chosen.addEventListener("change", show);
beside.addEventListener("change", show);
const again = () => runs().catch((error) => {
  if (!shown.length) panes.textContent = `No run to be shown: ${error.message}`;
}).finally(() => setTimeout(again, 3000));
again();
