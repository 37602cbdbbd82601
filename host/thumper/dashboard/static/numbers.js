// Numbers as text.

// Format with a number of decimal digits. A rounded zero has no sign.
export const fixed = (value, digits) => value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1");
