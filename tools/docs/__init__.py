"""The documentation site and the man pages. References of commands, configuration, report and API are generated."""
