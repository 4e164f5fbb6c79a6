// Effects that can be added to the simulated machine, as model files have them.

export interface EffectTemplate {
  name: string;
  toml: string;
}

const COGGING = `[[effects]]
kind = "cogging"
where = "screw"
order = 12
amplitude = 0.03
phase = 0.4
`;

export const EFFECTS: EffectTemplate[] = [
  { name: "none", toml: "" },
  { name: "cogging of the screw's motor", toml: COGGING },
];
