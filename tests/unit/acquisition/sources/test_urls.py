"""URLs of sources: taken apart, their backends found, every mistake one line."""

import pytest

from acquisition.sources import open_source, parse_url, urls
from acquisition.sources.file_source import FileSource
from acquisition.sources.simulated_source import SimulatedSource
from sloshlab.errors import SourceError


@pytest.mark.parametrize(
    ("text", "scheme", "target", "options"),
    [
        ("file:RUN.nc", "file", "RUN.nc", {}),
        ("file:a/b c.nc?real_time=yes&speed=2.5", "file", "a/b c.nc", {"real_time": "yes", "speed": "2.5"}),
        ("file:C:\\runs\\a.nc", "file", "C:\\runs\\a.nc", {}),
        ("serial:/dev/ttyUSB0?", "serial", "/dev/ttyUSB0", {}),
        (
            "serial:socket://127.0.0.1:7000?baudrate=9600",
            "serial",
            "socket://127.0.0.1:7000",
            {"baudrate": "9600"},
        ),
        ("can:slcan?channel=/dev/a%26b&dbc=x=y.dbc", "can", "slcan", {"channel": "/dev/a&b", "dbc": "x=y.dbc"}),
        ("file:100%25%3F.nc?device=a+b", "file", "100%?.nc", {"device": "a+b"}),
        ("sim:", "sim", "", {}),
    ],
)
def test_a_url_is_taken_apart(text, scheme, target, options):
    url = parse_url(text)
    assert (url.text, url.scheme, url.target, dict(url.options)) == (text, scheme, target, options)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("run.nc", "no scheme.*remedy: write file:run.nc"),
        (":run.nc", "no scheme"),
        ("", "no scheme"),
        ("FILE:run.nc", "no scheme"),
        ("file:run.nc?speed", "got 'speed'; allowed: option=value"),
        ("file:run.nc?=2", "got '=2'"),
        ("file:run.nc?speed=1&speed=2", "got option 'speed' twice"),
        ("file:run\n.nc", "printable"),
        ("file:" + "x" * 5000, "got 5005 characters"),
    ],
)
def test_a_malformed_url_is_refused_in_one_line(text, said):
    with pytest.raises(SourceError, match=said) as caught:
        parse_url(text)
    assert "\n" not in str(caught.value)


def test_backends_are_found_by_their_scheme(tmp_path):
    assert isinstance(open_source(f"file:{tmp_path}/run.nc"), FileSource)
    assert isinstance(open_source("sim:shaker_vfa?rig=rig.toml"), SimulatedSource)


def test_an_unknown_scheme_names_those_there_are():
    with pytest.raises(SourceError, match=r"source usb:1: got 'usb'; allowed: can, file, serial, sim; remedy"):
        open_source("usb:1")


def test_a_plug_in_brings_its_own_scheme(monkeypatch):
    # an editable and a plain installation side by side declare it twice
    monkeypatch.setitem(urls.BACKENDS._offered, "bench", ["fractions:Fraction", "fractions:Fraction"])
    monkeypatch.setattr("fractions.Fraction", lambda url: ("made of", url.target))
    assert open_source("bench:7") == ("made of", "7")


@pytest.mark.parametrize(
    ("value", "said"),
    [("no_such_package:Source", "cannot be imported"), ("fractions:NoSuchClass", "cannot be imported")],
)
def test_a_backend_that_cannot_be_imported_is_one_line(monkeypatch, value, said):
    monkeypatch.setitem(urls.BACKENDS._offered, "bench", [value])
    with pytest.raises(SourceError, match=said):
        open_source("bench:7")


def test_two_backends_of_one_scheme_are_refused(monkeypatch):
    monkeypatch.setitem(urls.BACKENDS._offered, "bench", ["fractions:Fraction", "decimal:Decimal"])
    with pytest.raises(SourceError, match="2 backends"):
        open_source("bench:7")


def options_of(query):
    return urls.URLOptions(parse_url(f"sim:shaker_sweep?{query}"))


def test_options_are_read_with_their_types():
    options = options_of("a=x&b=1e3&c=-7&d=no")
    assert options.text("a") == "x"
    assert options.number("b", 1.0, lowest=0, highest=1e3) == 1000.0
    assert options.integer("c", 1, lowest=-7, highest=7) == -7
    assert options.yes("d", True) is False
    options.refuse_others()


def test_options_that_are_not_given_have_their_defaults():
    options = options_of("")
    assert options.text("a") is None
    assert options.number("b", 1.5, lowest=0, highest=2) == 1.5
    assert options.integer("c", 3, lowest=0, highest=9) == 3
    assert options.yes("d", True) is True
    assert options.choice("e", "up", ("up", "down")) == "up"


@pytest.mark.parametrize("text", ["nan", "inf", "-1", "2.1", "two", "1_0", ""])
def test_a_number_out_of_range_is_refused(text):
    with pytest.raises(SourceError, match=r"allowed: a number, 0 … 2|option=value"):
        options_of(f"b={text}").number("b", 1.0, lowest=0, highest=2)


@pytest.mark.parametrize("text", ["1.0", "10", "-1", "0x3", "٣", "9" * 30])
def test_a_whole_number_out_of_range_is_refused(text):
    with pytest.raises(SourceError, match="allowed: a whole number, 0 … 9"):
        options_of(f"c={text}").integer("c", 1, lowest=0, highest=9)


def test_words_that_are_not_allowed_are_refused():
    with pytest.raises(SourceError, match="d: got 'maybe'; allowed: yes, no"):
        options_of("d=maybe").yes("d", True)
    with pytest.raises(SourceError, match="e: got 'left'; allowed: up, down"):
        options_of("e=left").choice("e", "up", ("up", "down"))


def test_an_option_that_nobody_asked_for_is_refused():
    options = options_of("speed=2&sped=3")
    options.number("speed", 1.0, lowest=0, highest=9)
    options.text("device")
    with pytest.raises(SourceError, match="sped: got '3'; allowed: options device, speed"):
        options.refuse_others()


@pytest.mark.parametrize(
    ("default", "made"), [("fill 0.50 süß", "fill_0.50_s_"), ("__x", "x"), ("///", "sim"), ("x" * 99, "x" * 64)]
)
def test_a_device_has_a_short_plain_name(default, made):
    assert options_of("").device(default) == made


@pytest.mark.parametrize("name", ["a b", "-a", "ä", "x" * 65, "a/b"])
def test_a_device_name_that_is_none_is_refused(name):
    with pytest.raises(SourceError, match="device: got"):
        options_of(f"device={name}").device("shaker")
