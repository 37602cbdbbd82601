// A question in the row of a list. A dialog of the browser would hold the page, and with it the robot.

// Ask before `act`, whose button is named `verb`. `back` shows the row as it was.
export function askInRow(row, { question, verb, name, act, back }) {
  const label = document.createElement("label");
  label.textContent = question;
  row.replaceChildren(label);
  const addButton = (text, description, className, action) => {
    const button = row.appendChild(document.createElement("button"));
    Object.assign(button, { type: "button", className, textContent: text });
    button.setAttribute("aria-label", description);
    button.addEventListener("click", action);
    return button;
  };
  addButton(verb, `${verb} ${name} for good`, "tp-plain tp-danger", () => {
    act();
    back();
  });
  addButton("Keep", `Keep ${name}`, "tp-plain", back).focus();
}
