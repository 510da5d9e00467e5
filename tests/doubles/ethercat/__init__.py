"""EtherCAT segment of one EK1100 coupler and EL3783 terminals on one end of a veth pair.

`python -m tests.doubles.ethercat --interface NAME` runs it; `control.EtherCatDouble` starts that process for a test.
Registers, datagrams, SII, mailbox and states follow ETG.1000 (parts 4 and 6) and Beckhoff's "Hardware Data Sheet
ET1100, Section II". What the terminal's manual leaves open is marked as assumed where it is used.
"""
