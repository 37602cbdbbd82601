// A tone from the computer or phone that shows the page.

const PITCH_HZ = 880;
const DURATION_S = 0.3;

export function beep() {
  const audio = new AudioContext(); // silent until the user has clicked the page once
  const tone = audio.createOscillator();
  tone.frequency.value = PITCH_HZ;
  tone.connect(audio.destination);
  tone.addEventListener("ended", () => audio.close());
  tone.start();
  tone.stop(audio.currentTime + DURATION_S);
}
