"""The words of a header in plain English letters: signs spelled out, other languages translated.

Loggers write headers in the language of their user: "Время, с", "磁场X(uT)", "Magnetfeld x (µT)".
A word that is not known stays as it is, so that what it stands for is never taken for another.
"""

from __future__ import annotations

import re
import unicodedata

_SIGNS = str.maketrans(
    {"μ": "u", "µ": "u", "°": "deg", "º": "deg", "%": "percent", "ʯ": "u", "℃": "degC"}
)

_BROKEN = tuple(
    (re.compile(pattern), whole)
    for pattern, whole in (
        (r"Âµ|Î¼|¬µ|Î1⁄4", "u"),
        (r"Â°|¬∞", "deg"),
        (r"Â²|¬≤", "2"),
        (r"(?<=[\[({_ ,;])(?:\?{1,2}|\ufffd{1,2}|ï¿½)(?=T(?:esla)?\b|s\b)", "u"),
        (r"(?<=[\[({_ ,;])(?:\?{1,2}|\ufffd{1,2}|ï¿½)(?=/s|[CF]?[\])}]?$)", "deg"),
        (r"(?<=/s)(?:\?{1,2}|\ufffd{1,2}|ï¿½)", "2"),
    )
)
"""Signs that were read in another encoding than they were written in, or lost: of the units of a
field, or of a time, only µT and µs have a letter that can be."""

_UNITS = {
    "нтл": "nT", "мктл": "uT", "мтл": "mT", "тл": "T", "гс": "G", "мгс": "mG", "гаусс": "G",
    "с": "s", "сек": "s", "мс": "ms", "мкс": "us", "нс": "ns", "мин": "min",
    "град": "deg", "рад": "rad", "м": "m", "а": "A", "ма": "mA",
    "纳特": "nT", "微特": "uT", "毫特": "mT", "毫高斯": "mG", "高斯": "G", "特斯拉": "T",
    "微特斯拉": "uT", "纳特斯拉": "nT", "毫特斯拉": "mT",
    "毫秒": "ms", "微秒": "us", "纳秒": "ns", "秒": "s",
    "弧度": "rad", "度": "deg", "摄氏度": "degC",
}  # fmt: skip
_NAMES = {
    "time": "время time-stamp zeit zeitstempel temps tiempo tempo tijd czas zaman 时间 時間 时间戳",
    "date": "дата datum fecha 日期",
    "temperature": "температура темп temperatur température temperatura 温度",
    "magnetometer": "магнитометр магн маг magnétomètre magnetómetro 磁力计 磁力計 磁强计 磁感应计",
    "magneticfield": "магнполе магнитноеполе полемагнитное feld магнитнаяиндукция magnetfeld "
    "champmagnétique magnetischveld polemagnetyczne manyetikalan "
    "campomagnético campomagnetico 磁场 磁場 地磁 地磁場 磁感应强度",
    "accelerometer": "акселерометр beschleunigungssensor accéléromètre acelerómetro 加速度计",
    "acceleration": "ускорение beschleunigung accélération aceleración 加速度",
    "gyroscope": "гироскоп gyroskop gyroscope giroscopio 陀螺仪",
    "angularvelocity": "угловаяскорость drehrate winkelgeschwindigkeit vitesseangulaire "
    "velocidadangular 角速度",
    "roll": "крен 横滚 横滚角 滚转角",
    "pitch": "тангаж 俯仰 俯仰角",
    "yaw": "рыскание 偏航 偏航角 航向角",
    "heading": "курс 航向",
    "latitude": "широта 纬度",
    "longitude": "долгота 经度",
    "altitude": "высота 高度",
    "current": "ток 电流",
    "quaternion": "кватернион 四元数",
    "axis": "ось оси 轴",
    "bias": "смещение 偏移 零偏",
    "norm": "модуль 模",
    "error": "ошибка погрешность 误差",
    "sensor": "датчик сенсор 传感器",
    "station": "станция положение позиция",
}
_ENGLISH = {
    **_UNITS,
    **{theirs: ours for ours, words in _NAMES.items() for theirs in words.split()},
}
_IDEOGRAMS = {word: ours for word, ours in _ENGLISH.items() if ord(word[0]) > 0x2E80}
_IDEOGRAM = re.compile("|".join(sorted(_IDEOGRAMS, key=len, reverse=True)))
_PAIRS = {
    ("магн", "поле"), ("магнитное", "поле"), ("магнитная", "индукция"), ("угловая", "скорость"),
    ("champ", "magnétique"), ("campo", "magnético"), ("campo", "magnetico"),
    ("magnetisch", "veld"), ("pole", "magnetyczne"), ("manyetik", "alan"),
    ("vitesse", "angulaire"), ("velocidad", "angular"),
}  # fmt: skip
_PAIR = re.compile("|".join(rf"\b{a}\.?\s+{b}\b" for a, b in sorted(_PAIRS)), re.IGNORECASE)
ZONE = re.compile(r"[\s,;_(\[]*(?:UTC|GMT)\s*([+-])(\d{1,2})(?::?(\d\d))?[\s)\]]*$")
"""How the header of a time names its zone: `Date Time, GMT+03:00`."""
_WORD = re.compile(r"[^\W\d_]+")
_LOOK_ALIKE = dict(zip("АВЕКМНОРСТУХавекмнорстух", "ABEKMHOPCTYXabekmhopctyx", strict=True))
"""Cyrillic letters that a keyboard puts where Latin ones are meant: Вх, °С."""


def spell_out(text: str) -> str:
    """A header with its signs spelled out and the words that are known in English.

    >>> spell_out("Магнитное поле X, мкТл"), spell_out("磁场Y(uT)"), spell_out("T, °C")
    ('magneticfield X, uT', ' magneticfield Y(uT)', 'T, degC')
    >>> spell_out("Bx (ÂµT)"), spell_out("Bx (?T)"), spell_out("acc x (m/s\ufffd)")
    ('Bx (uT)', 'Bx (uT)', 'acc x (m/s2)')
    """
    for broken, whole in _BROKEN:
        text = broken.sub(whole, text)
    plain = unicodedata.normalize("NFC", text).translate(_SIGNS)
    plain = plain.replace("\\mu", "u").replace("$", "")  # as in TeX
    if plain.isascii():
        return _translate(plain)
    plain = unicodedata.normalize("NFKC", plain).translate(_SIGNS)
    plain = _IDEOGRAM.sub(lambda word: f" {_IDEOGRAMS[word[0]]} ", plain)
    return _translate(plain)


def _translate(text: str) -> str:
    """The words of a text, single and in pairs, in English."""
    joined = _PAIR.sub(lambda pair: re.sub(r"[\s.]+", "", pair[0]), text)
    return _WORD.sub(lambda word: _translate_word(word[0]), joined)


def _translate_word(word: str) -> str:
    if len(word) > 1 and (known := _ENGLISH.get(word.lower())):
        return known
    latin = "".join(_LOOK_ALIKE.get(letter, letter) for letter in word)
    if len(word) == 1:
        return _ENGLISH.get(word, latin)
    return latin if latin.isascii() and (len(word) <= 3 or word[:3] == "deg") else word
