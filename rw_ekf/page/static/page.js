// The page: which runs are shown, and the button that stops the wheel.
"use strict";

const chosen = document.getElementById("run"), beside = document.getElementById("beside"), panes = document.getElementById("panes");
let shown = [], newest = true, all = "The wheel has", stopped = ""; // what was answered to the button

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
    const before = chosen.value;
    const options = () => told.runs.map((name) => new Option(name, name));
    chosen.replaceChildren(...options());
    const second = beside.value;
    beside.replaceChildren(new Option("none", ""), ...options());
    beside.value = told.runs.includes(second) ? second : "";
    chosen.value = before;
    if (chosen.value !== before) show();
  }
  const lives = shown[0] && shown[0].state && shown[0].state.alive;
  if (newest && !lives && chosen.value !== (told.runs[0] || "")) { // who watches the newest goes on with the next, from
    chosen.value = told.runs[0] || ""; // one that lives on with no other of its line
    show();
  }
  if (told.wheels > 1) {
    for (const id of ["stop", "sure-yes"]) document.getElementById(id).textContent = `Stop all ${told.wheels} wheels`;
    document.getElementById("sure-all").textContent = ` of all ${told.wheels} wheels of the line`;
  }
  all = told.wheels > 1 ? `All ${told.wheels} wheels have` : "The wheel has";
  document.getElementById("stop").hidden = !(told.stop && token());
}

const sure = document.getElementById("sure"), answer = document.getElementById("sure-answer");
document.getElementById("stop").addEventListener("click", () => { answer.textContent = ""; sure.showModal(); });
document.getElementById("sure-no").addEventListener("click", () => sure.close());
document.getElementById("sure-yes").addEventListener("click", async () => {
  answer.textContent = "zero is being written ...";
  try {
    const told = await (await ask("api/stop", { method: "POST" })).json();
    stopped = told.zero_confirmed ? `${all} confirmed zero current.` : "";
    answer.textContent = stopped || `NOT confirmed: ${told.error && (told.error.messages || [told.error]).join("; ")}`;
  } catch (error) { answer.textContent = `NOT done: ${error.message}. rw-ekf stop, or cut its power.`; }
});
chosen.addEventListener("change", () => { newest = chosen.selectedIndex === 0; show(); });
beside.addEventListener("change", show);
const again = () => runs().catch((error) => {
  if (!shown.length) panes.textContent = `No run to be shown: ${error.message}`;
}).finally(() => setTimeout(again, 3000));
again();
