// German by the English words; {} stands for a value.

export const GERMAN = {};
