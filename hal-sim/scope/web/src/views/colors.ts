/** Colours of the curves of a plot, in their order. */
export const COLORS = ["#3b82f6", "#e8590c", "#2f9e44", "#c2255c", "#7048e8", "#0c8599", "#a16207", "#868e96"];
