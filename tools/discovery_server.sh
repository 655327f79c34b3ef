#!/usr/bin/env bash
# Run a Fast DDS Discovery Server: that of the ROS which is sourced, or that of an environment.
#
#   tools/discovery_server.sh VENV [ADDRESS [PORT]]
set -euo pipefail
venv=$1 address=${2:-127.0.0.1} port=${3:-11811}
echo "for each program: export ROS_DISCOVERY_SERVER=$address:$port"
if command -v fast-discovery-server > /dev/null; then
    exec fast-discovery-server -i 0 -l "$address" -p "$port"
fi
# The wheel does not say where its libraries are.
libraries=$(printf '%s:' "$venv"/lib "$venv"/lib/python3.*/site-packages/ros_fast*.libs)
LD_LIBRARY_PATH=$libraries${LD_LIBRARY_PATH:-} \
    exec "$venv"/bin/fast-discovery-server -i 0 -l "$address" -p "$port"
