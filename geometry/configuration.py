"""What a controller says beside a pose: which of the arm's solutions its joints are in."""

from __future__ import annotations

from dataclasses import dataclass

from geometry.errors import InputError


@dataclass(frozen=True)
class ArmConfiguration:
    """The configuration of an arm as its controller writes it; what is not given is None or empty.

    Parameters
    ----------
    status : int or None
        KUKA's S: bit 0 the wrist's root stands behind axis 1, bit 1 the elbow's side, bit 2 the sign of axis 5.
    turn : int or None
        KUKA's T: bit i is set where axis i + 1 reads below zero.
    quadrants : tuple of int or None
        ABB's cf1, cf4, cf6 (quarter turns of axes 1, 4, 6, rounded down) and cfx.
    letters : str
        FANUC's: N or F (wrist not flipped or flipped), L or R (left or right), U or D (elbow up or down), T or B (front
        or back).
    turns : tuple of int
        FANUC's turn numbers behind the letters: 0 for −179.999° … 179.999°, one more or less each further turn.
    """

    status: int | None = None
    turn: int | None = None
    quadrants: tuple[int, int, int, int] | None = None
    letters: str = ""
    turns: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything is given."""
        return self != ArmConfiguration()


def parse_bits(text: str) -> int:
    """KUKA's S or T: a whole number, or bits as the controller writes them (B010, 'B010', 2#010).

    Raises
    ------
    InputError
        Where it is neither.
    """
    plain = text.strip().strip("'\"").upper()
    for prefix in ("B", "2#"):
        if plain.startswith(prefix) and 0 < len(bits := plain[len(prefix) :]) <= 32 and set(bits) <= {"0", "1"}:
            return int(bits, 2)
    digits = plain.partition(".")
    if digits[0].isascii() and digits[0].isdigit() and len(digits[0]) < 9 and set(digits[2]) <= {"0"}:
        return int(digits[0])
    raise InputError(f'"{text[:40]}" is neither a whole number nor bits such as B010')


def parse_letters(text: str) -> tuple[str, tuple[int, ...]]:
    """FANUC's CONFIG, such as N U T, 0, 0, 0: letters and turn numbers.

    Raises
    ------
    InputError
        Where a letter is unknown, two contradict each other or a turn number is none.
    """
    plain = text.strip().strip("'\"").upper().removeprefix("CONFIG").lstrip(" :=").strip("'\" ")
    letters, numbers = "", []
    for word in plain.replace(",", " ").replace(";", " ").split():
        digits = word[1:] if word[0] in "+-" else word
        if digits.isascii() and digits.isdigit() and len(digits) < 4:
            numbers.append(int(word))
        elif set(word) <= set("NFLRUDTB"):
            letters += word
        else:
            raise InputError(f'"{text[:40]}" is no configuration such as N U T, 0, 0, 0')
    for pair in ("NF", "LR", "UD", "TB"):
        if sum(letters.count(letter) for letter in pair) > 1:
            raise InputError(f'"{text[:40]}": {pair[0]} and {pair[1]} can not both be right')
    if not letters or len(numbers) > 3:
        raise InputError(f'"{text[:40]}" is no configuration such as N U T, 0, 0, 0')
    return letters, tuple(numbers)
