#!/usr/bin/python3
"""A Modbus server of pymodbus 3.0, for tests: 200 coils and 200 holding registers of unit 1, all 0, addressed from 0.

modbus_server.py tcp PORT | modbus_server.py rtu DEVICE
"""
import sys

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.framer.rtu_framer import ModbusRtuFramer
from pymodbus.server import StartSerialServer, StartTcpServer


def main():
    slave = ModbusSlaveContext(
        co=ModbusSequentialDataBlock(0, [0] * 200),
        hr=ModbusSequentialDataBlock(0, [0] * 200),
        zero_mode=True,
    )
    context = ModbusServerContext(slaves={1: slave}, single=False)
    if sys.argv[1] == "tcp":
        StartTcpServer(context=context, address=("127.0.0.1", int(sys.argv[2])))
    else:
        StartSerialServer(context=context, framer=ModbusRtuFramer, port=sys.argv[2], baudrate=115200, timeout=0.005)


if __name__ == "__main__":
    main()
