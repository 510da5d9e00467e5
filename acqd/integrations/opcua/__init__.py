"""An OPC UA server with the rows as variables; needs acqd[opcua]."""
