// Sounds made on the spot. Loud means attention-getting, not harmful: the gain is capped and a limiter follows it.

import { Emitter } from "../common/emitter.js";

export const MAX_GAIN = 0.7;
/** @type {[after_s: number, hertz: number][]} */
const ALARM = [
  [0.0, 880],
  [0.18, 1175],
  [0.36, 880],
  [0.54, 1175],
  [1.0, 880],
  [1.18, 1175],
  [1.36, 880],
  [1.54, 1175],
];
const BEEP_S = 0.15;

/**
 * Emits "state" when the browser lets sound through, or stops doing so.
 *
 * @extends {Emitter<{ state: null }>}
 */
export class Sound extends Emitter {
  constructor() {
    super();
    /** @type {AudioContext | null} */
    this.context = null;
    /** @type {AnalyserNode | null} */
    this.analyser = null; // taps what goes to the loudspeaker; tests look here
    /** @type {GainNode | null} */
    this._master = null;
    /** @type {Set<OscillatorNode>} */
    this._playing = new Set();
    const unlock = () => this.unlock();
    for (const event of ["pointerdown", "keydown"]) addEventListener(event, unlock, { capture: true, passive: true });
  }

  /**
   * Sound can be heard now, as far as the browser is concerned.
   *
   * @returns {boolean}
   */
  get ready() {
    return this.context?.state === "running";
  }

  /**
   * Browsers keep pages silent until the person did something; call this from a press or a key.
   *
   * @returns {Promise<boolean>} whether it can be heard now
   */
  async unlock() {
    if (this.ready) return true;
    try {
      this.context ??= this._build();
      await Promise.race([this.context.resume(), new Promise((resolve) => setTimeout(resolve, 500))]);
    } catch {
      return false;
    }
    this.emit("state");
    return this.ready;
  }

  /**
   * Plays the alarm of a reading. Resolves to whether it really sounded.
   *
   * @returns {Promise<boolean>}
   */
  async alarm() {
    if (!(await this.unlock()) || !this.context) return false;
    this.silence();
    const start = this.context.currentTime + 0.02;
    for (const [after, hertz] of ALARM) this._beep(start + after, hertz, BEEP_S, MAX_GAIN);
    return true;
  }

  /**
   * Plays so many tones, apart enough to be counted. Resolves to whether they really sounded.
   *
   * @param {number} count
   * @returns {Promise<boolean>}
   */
  async tones(count) {
    if (!(await this.unlock()) || !this.context) return false;
    this.silence();
    const start = this.context.currentTime + 0.2;
    for (let tone = 0; tone < count; tone += 1) this._beep(start + 0.5 * tone, 660, 0.22, 0.4);
    return true;
  }

  /**
   * A short soft tone for "saved".
   *
   * @returns {Promise<void>}
   */
  async confirm() {
    if (!this.ready || !this.context) return;
    const start = this.context.currentTime + 0.01;
    this._beep(start, 660, 0.09, 0.15);
    this._beep(start + 0.1, 990, 0.12, 0.15);
  }

  /**
   * Two short falling tones: something slipped. Lower and softer than an alarm, and not to be confused with it.
   *
   * @returns {Promise<boolean>} whether they really sounded
   */
  async slipped() {
    if (!(await this.unlock()) || !this.context) return false;
    const start = this.context.currentTime + 0.01;
    this._beep(start, 330, 0.12, 0.35);
    this._beep(start + 0.14, 196, 0.2, 0.35);
    return true;
  }

  /** @returns {void} */
  silence() {
    for (const tone of this._playing) {
      try {
        tone.stop();
      } catch {
        // it had already ended
      }
    }
    this._playing.clear();
  }

  /** @returns {AudioContext} */
  _build() {
    const context = new AudioContext();
    const master = new GainNode(context, { gain: MAX_GAIN });
    const limiter = new DynamicsCompressorNode(context, {
      threshold: -6,
      knee: 0,
      ratio: 20,
      attack: 0.002,
      release: 0.1,
    });
    this.analyser = new AnalyserNode(context, { fftSize: 2048 });
    master.connect(limiter).connect(this.analyser).connect(context.destination);
    context.addEventListener("statechange", () => this.emit("state"));
    this._master = master;
    return context;
  }

  /**
   * @param {number} at in the context's seconds
   * @param {number} hertz
   * @param {number} seconds
   * @param {number} gain
   */
  _beep(at, hertz, seconds, gain) {
    if (!this.context || !this._master) return;
    const tone = new OscillatorNode(this.context, { type: "square", frequency: hertz });
    const soften = new BiquadFilterNode(this.context, { type: "lowpass", frequency: 4 * hertz });
    const envelope = new GainNode(this.context, { gain: 0 });
    envelope.gain.setValueAtTime(0, at);
    envelope.gain.linearRampToValueAtTime(Math.min(gain, MAX_GAIN), at + 0.01);
    envelope.gain.setValueAtTime(Math.min(gain, MAX_GAIN), at + seconds - 0.02);
    envelope.gain.linearRampToValueAtTime(0, at + seconds);
    tone.connect(soften).connect(envelope).connect(this._master);
    tone.addEventListener("ended", () => this._playing.delete(tone));
    tone.start(at);
    tone.stop(at + seconds + 0.02);
    this._playing.add(tone);
  }
}
