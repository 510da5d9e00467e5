"""Installs acqd as services of systemd: user, folders, units, capabilities, broker password and ACL; removes them."""
