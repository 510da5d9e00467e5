"""Roles of channels from unit, phase field, name and each other."""

from __future__ import annotations

from pathlib import Path

import pytest

from acqd.errors import InputError
from acqd.sources.recording.channel import Channel, Recording
from acqd.sources.recording.roles import roles_of
from acqd.sources.recording.selection import chosen
from acqd.sources.recording.suggestion import suggestion
from acqd.sources.recording.units import UnknownUnitError, split_label, unit_of


def channels(text: str) -> list[Channel]:
    """`VA|kV|A` for name, unit and phase field; the unit follows from the first letter where there is none."""
    found = []
    for item in text.split():
        name, unit, phase, *_ = [*item.split("|"), "", ""]
        letter = name.lstrip("0123456789")[:1].upper()
        found.append(Channel(name, unit or {"U": "V", "V": "kV", "I": "A"}.get(letter, ""), phase))
    return found


def metered(text: str) -> dict[str, str]:
    listed = channels(text)
    recording = Recording(Path("r.cfg"), "test", listed, 1, lambda k: None, 1.0)  # type: ignore[arg-type, return-value]
    return {key: listed[k].name for key, k in chosen(recording, roles_of(listed)).keys}


PHASES = {
    "VA VB VC",
    "UL1 UL2 UL3",
    "VR VY VB",
    "UR US UT",
    "UU UV UW",
    "UL1-N UL2-N UL3-N",
    "VAN VBN VCN",
    "U_A U_B U_C",
}
BESIDE = ["", "VDC", "VS", "VSYNC", "VN IN", "3I0 3U0", "IRES", "VBAT IDC", "UE IE", "UA_RMS IA_MAG", "VREF"]


@pytest.mark.parametrize("names", ["U|V|{} I|A|{}", "V|V|{} I|A|{}", "Voltage||{} Current||{}"])
@pytest.mark.parametrize("fields", [("L1", "L2", "L3"), ("A", "B", "C"), ("R", "S", "T"), ("U", "V", "W")])
def test_the_phase_field_decides_where_a_name_says_a_quantity_alone(names, fields):
    listed = channels(" ".join(names.format(field, field) for field in fields))
    found = [(role.kind, role.quantity, role.phases) for role in roles_of(listed)]
    assert found == [("phase", quantity, (phase,)) for phase in (1, 2, 3) for quantity in "ui"]


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("names", sorted(PHASES))
def test_three_phases_are_named_among_anything_else(names, beside):
    if beside == "VS" and names == "UR US UT":
        pytest.skip("there S is a phase twice, and refused")
    currents = " ".join("I" + name[1:].split("-")[0].removesuffix("N") for name in names.split())
    found = metered(f"{beside} {names} {beside.lower()} {currents}" if not beside else f"{beside} {names} {currents}")
    assert [found[f"u{k}"] for k in (1, 2, 3)] == names.split()
    assert [found[f"i{k}"] for k in (1, 2, 3)] == currents.split()


@pytest.mark.parametrize("names", ["VAB VBC VCA", "UL12 UL23 UL31", "U12 U23 U31", "VAB|kV|A VBC|kV|B VCA|kV|C", "VRY VYB VBR",  # noqa: E501
                                   "VA|kV|AB VB|kV|BC VC|kV|CA", "UL1-L2 UL2-L3 UL3-L1", "U12 U23", "VA-VB VB-VC VC-VA"])  # fmt: skip  # noqa: E501
def test_voltages_between_lines_are_never_those_of_phases(names):
    letters = "RYB" if "VRY" in names else "ABC"
    found = metered(names + "".join(f" I{letter}" for letter in letters))
    assert not {"u1", "u2", "u3"} & set(found)
    assert [found[key] for key in ("u12", "u23")] == [item.split("|")[0] for item in names.split()[:2]]


def test_phase_voltages_win_over_those_between_lines_in_any_order():
    for names in ("VAB VBC VCA VA VB VC", "VA VB VC VAB VBC VCA", "VAB VA VBC VB VCA VC"):
        assert metered(names + " IA IB IC")["u1"] == "VA"


@pytest.mark.parametrize(
    ("text", "u2", "i2"),
    [
        ("MMXU1.PhV.phsA|V MMXU1.PhV.phsB|V MMXU1.PhV.phsC|V MMXU1.A.neut|A MMXU1.A.phsA|A MMXU1.A.phsB|A "
         "MMXU1.A.phsC|A", "MMXU1.PhV.phsB", "MMXU1.A.phsB"),
        ("TVTR1.VolSv.instMag|V|A TVTR2.VolSv.instMag|V|B TVTR3.VolSv.instMag|V|C TCTR1.AmpSv.instMag|A|A "
         "TCTR2.AmpSv.instMag|A|B TCTR3.AmpSv.instMag|A|C TCTR4.AmpSv.instMag|A|N", "TVTR2.VolSv.instMag",
         "TCTR2.AmpSv.instMag"),
        ("Tensão_A|V Tensão_B|V Tensão_C|V Corrente_A|A Corrente_B|A Corrente_C|A Corrente_Neutro|A", "Tensão_B",
         "Corrente_B"),
        ("Напряжение_A|V Напряжение_B|V Напряжение_C|V Ток_A|A Ток_B|A Ток_C|A Ток_нейтрали|A", "Напряжение_B",
         "Ток_B"),
        ("零序电流|A A相电压|V B相电压|V C相电压|V A相电流|A B相电流|A C相电流|A", "B相电压", "B相电流"),
    ],
)  # fmt: skip
def test_names_of_iec_61850_and_of_other_languages(text, u2, i2):
    found = metered(text)
    assert (found["u2"], found["i2"]) == (u2, i2) and len(found) == 6


def test_the_phase_field_names_channels_whose_names_say_nothing():
    text = "x|V|AN y|V|BN z|V|C-N p|A|A q|A|B k|A|3"
    with pytest.raises(InputError):  # letters and a number are of two families, but mean phases all the same
        metered("x|V|A y|V|A p|A|A q|A|A")
    assert metered(text)["u2"] == "y" and metered(text)["i3"] == "k"


def test_what_the_unit_says_wins_over_the_name_and_contradictions_are_refused():
    assert metered("L1|V L2|V L3|V L1|A L2|A L3|A")["i2"] == "L2"
    with pytest.raises(InputError, match=r"'IA': its name says current, its unit mV.*--i-scale"):
        metered("VA IA|mV")
    with pytest.raises(InputError, match=r"unit 'bananas' is unknown"):
        metered("VA|bananas IA")


@pytest.mark.parametrize(
    ("text", "why"),
    [("V1 V2 V0 I1 I2 I0", "no voltage and current pair"), ("VDC IDC", "no voltage and current pair"),
     ("IA IB IC VS", "has i1 but no u1"), ("VA VB VC IA IC", "u2 but no i2"),
     ("VA VB VC IA1 IB1 IC1 IA2 IB2 IC2", "two columns for i1"), ("U12 U32 I1 I3", "has i1 but no u1"),
     ("U_alpha U_beta I_alpha I_beta", "no voltage and current pair"), ("Vgrid Vload Igrid", "two columns for u1"),
     ("VA|kV|A VC|kV|B VB|kV|C IA|A|A IC|A|B IB|A|C", "its name and its phase field B disagree"),
     ("IRA IRB IRC URA URB URC", "two columns for u1|three columns for [ui]1"),
     ("VLL_A VLL_B VLL_C IA IB IC", "has i1 but no u1.*u12="), ("U1_verkettet U2_verkettet I1 I2", "has i1 but no u1"),
     ("V_line_to_line_A V_line_to_line_B IA IB", "has i1 but no u1.*u12="), ("Vpp_A IA", "has i1 but no u1"),
     ("VA|kV|B IA", "its name and its phase field B disagree"), ("VA_MAG|kV VA|kV|N IA", "has i1 but no u1")],
)  # fmt: skip
def test_what_stays_ambiguous_is_refused_with_a_line_to_type(text, why):
    with pytest.raises(InputError, match=rf"{why}.*--map .*=.*0="):
        metered(text)


def test_a_pair_that_names_its_place_is_l1():
    assert metered("Vgrid Igrid VDC") == {"u1": "Vgrid", "i1": "Igrid"}
    assert metered("V_mains I_mains") == {"u1": "V_mains", "i1": "I_mains"}


@pytest.mark.parametrize("unit", ["x100 V", "V*10", "V/100", "mV/A", "V x 10"])
def test_a_scale_beside_a_unit_is_refused_and_never_cut_off(unit):
    assert split_label(f"u1 [{unit}]") == ("u1", unit)
    with pytest.raises(UnknownUnitError):
        unit_of(unit)


@pytest.mark.parametrize("label", ["u1 (V) x10", "u1*1000", "u1_x100", "u1 x10 (V)", "u1 [% of 230V]", "u1 100x"])
def test_a_factor_in_a_name_is_refused_and_one_of_1_is_not(label):
    with pytest.raises(UnknownUnitError):
        unit_of(split_label(label)[1])
    assert split_label("Channel 2 x1 (V)")[1] == "V" and split_label("CH1 Ux2")[1] == ""


def test_the_name_of_a_bay_is_no_voltage_between_lines():
    assert metered("BAY1_VA|kV BAY1_VB|kV BAY1_VC|kV BAY1_IA|A BAY1_IB|A BAY1_IC|A")["u2"] == "BAY1_VB"


def test_inputs_of_an_oscilloscope_are_no_phases():
    assert metered("Channel_A|V Channel_B|A") == {"u1": "Channel_A", "i1": "Channel_B"}
    with pytest.raises(InputError, match="--u-scale 1 --i-scale 1"):
        metered("CH1|V CH2|V")
    assert metered("Input_A|V Input_B|A") == {"u1": "Input_A", "i1": "Input_B"}


@pytest.mark.parametrize("names", [("U_Input_{}", "I_Input_{}"), ("Voltage_Input_{}", "Current_Input_{}"),
                                   ("Input_{}_voltage", "Input_{}_current")])  # fmt: skip
@pytest.mark.parametrize("units", ["VA", ("", "")])
def test_the_input_of_a_converter_has_phases(names, units):
    text = " ".join(f"{name.format(x)}|{unit}" for name, unit in zip(names, units, strict=True) for x in "ABC")
    roles = roles_of([Channel(*item.split("|")) for item in text.split()])
    assert [(role.quantity, role.phases) for role in roles] == [(q, (k,)) for q in "ui" for k in (1, 2, 3)]


def test_of_whole_feeders_the_first_is_metered_and_voltages_of_one_are_not_mixed_with_currents_of_another():
    assert metered("VAW VBW VCW IAX IBX ICX IAW IBW ICW")["i1"] == "IAW"
    assert metered("U1A U1B U1C I1A I1B I1C U2A U2B U2C I2A I2B I2C")["u2"] == "U1B"
    assert metered("BUS_VA BUS_VB BUS_VC|kV F1_IA F1_IB F1_IC|A".replace("_VA", "_VA|kV").replace("_VB", "_VB|kV")
                   .replace("_IA", "_IA|A").replace("_IB", "_IB|A"))["i3"] == "F1_IC"  # fmt: skip


def test_letters_behind_a_slash_are_phases_beside_others_and_a_current_alone_is_in_amperes():
    labels = ["Voltage/A", "Current/A", "Current/B"]
    assert [split_label(label, labels) for label in labels] == [(label, "") for label in labels]
    assert split_label("Voltage, A") == ("Voltage, A", "") and split_label("I / A") == ("I", "A")
    assert split_label("u1/A") == ("u1", "A")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("V1|V V2|V V3|V A1|A A2|A A3|A", "V1 A1 V2 A2 V3 A3"),
        ("L1_U|V L1_I|A L2_U|V L2_I|A L3_U|V L3_I|A", "L1_U L1_I L2_U L2_I L3_U L3_I"),
        ("A1|V A2|A", "A1 A2"),  # inputs
        ("U1 U2 U3 I1 I2 I3 A1 A2 A3", "U1 I1 U2 I2 U3 I3"),
        ("U I A1 A2 A3", "U I"),
        ("A1|V|A A2|V|B A3|V|C A4|A|A A5|A|B A6|A|C", "A1 A4 A2 A5 A3 A6"),  # the field of the phase counts
        ("A_BUS_I|V B_BUS_I|V C_BUS_I|V IA|A IB|A IC|A", "A_BUS_I IA B_BUS_I IB C_BUS_I IC"),  # of bus bar I
    ],
)
def test_what_other_instruments_call_their_phases(text, expected):
    found = metered(text)
    assert [found[key] for key in sorted(found, key=lambda key: (key[1:], key[0] == "i"))] == expected.split()


@pytest.mark.parametrize("field", ["1", "A", "-"])
def test_a_phase_field_that_is_the_same_everywhere_says_nothing(field):
    text = " ".join(f"{name}|{'VA'[name[0] == 'I']}|{field}" for name in ("Ua", "Ub", "Uc", "Ia", "Ib", "Ic", "Un"))
    assert metered(text) == {"u1": "Ua", "u2": "Ub", "u3": "Uc", "i1": "Ia", "i2": "Ib", "i3": "Ic"}
    assert metered(f"U|V|{field.replace('-', 'A')} I|A|{field.replace('-', 'A')}") == {"u1": "U", "i1": "I"}


def test_arrays_are_numbered_from_0_and_letters_of_phases_may_be_cyrillic():
    assert (
        metered(" ".join(f"{name}[{k}]|{unit}" for name, unit in (("_ULN", "V"), ("I", "A")) for k in range(4)))["u3"]
        == "_ULN[2]"
    )
    listed = [Channel(f"{q}_фаза_{x}", u) for q, u in (("Напряжение", "V"), ("Ток", "A")) for x in "АВС"]
    assert [role.key for role in roles_of(listed)] == ["u1", "u2", "u3", "i1", "i2", "i3"]


def test_what_is_named_like_the_phases_is_not_left_out():
    with pytest.raises(InputError, match=r"named like those of the phases.*--map"):
        metered(" ".join(f"{q}_Fase_{x}|{u}" for q, u in (("Tensao", "V"), ("Corrente", "A")) for x in "ABV"))
    assert len(metered("U_Fase_A U_Fase_B U_Fase_N I_Fase_A I_Fase_B I_Fase_N")) == 4
    assert metered("V1|V A1|A V2|V A2|A") == {"u1": "V1", "i1": "A1", "u2": "V2", "i2": "A2"}


def test_units_in_names_and_words_in_phase_fields():
    assert metered("VAY(kV)|kV VBY(kV)|kV VCY(kV)|kV IAW(A)|A IBW(A)|A ICW(A)|A")["i3"] == "ICW(A)"
    assert metered("Current(A)|A Current(B)|A Current(C)|A V(A)|V V(B)|V V(C)|V")["i2"] == "Current(B)"
    listed = channels("Voltage|V|PhA Voltage|V|PhB Voltage|V|PhC Current|A|PhA Current|A|PhB Current|A|PhC")
    assert [role.key for role in roles_of(listed)] == ["u1", "u2", "u3", "i1", "i2", "i3"]
    assert metered("VA|V VB|V VC|V IA-1|A IB-1|A IC-1|A IN-1|A")["i1"] == "IA-1"
    names = ["u_u", "u_v", "u_w", "i_u", "i_v", "i_w"]
    assert [split_label(name, names) for name in names] == [(name, "") for name in names]
    assert split_label("u1_v", ["u1_v", "i1_a"]) == ("u1", "v")
    assert split_label("L1_V", ["L1_V", "L1_A", "L1_W"]) == ("L1", "V")


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        # as of a machine tool: more drives than a mains has phases
        (
            "X1_CurrentFeedback X1_OutputCurrent X1_OutputVoltage Y1_CurrentFeedback Y1_OutputCurrent "
            "Y1_OutputVoltage Z1_OutputCurrent Z1_OutputVoltage S1_OutputCurrent S1_OutputVoltage",
            "u1=2,i1=1",
        ),
        ("left_current aux_current right_current right_voltage left_voltage", "u1=3,i1=2,u2=4,i2=0"),
        ("probe_voltage left_current right_current", "u1=0,i1=?"),
        ("voltage_x voltage_y current_one current_two", "u1=0,i1=2,u2=1,i2=3"),
        ("left_voltage right_voltage top_voltage one_current two_current", "u1=?,i1=?"),
    ],
)
def test_a_suggestion_pairs_voltages_and_currents_by_their_names(names, expected):
    listed = [Channel(name, "V" if "olt" in name else "A") for name in names.split()]
    assert suggestion(listed, roles_of(listed)) == f"--map {expected}"
