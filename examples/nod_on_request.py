# Copyright 2026 kachaka_simple_control contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Wait for requests; at each, turn a little to the left and back."""

import threading

from kachaka_simple_control import ControlError, KachakaSimpleControl
import rclpy
from std_srvs.srv import Trigger


class NodOnRequest(KachakaSimpleControl):
    """Offers the service ``~/nod``."""

    def __init__(self):
        """Offer the service."""
        super().__init__()
        self._nodding = threading.Lock()
        self.create_service(Trigger, '~/nod', self._on_request)

    def _on_request(self, _request, response):
        # A callback must return soon, so the movement gets a thread of its own.
        response.success = self._nodding.acquire(blocking=False)
        if response.success:
            threading.Thread(target=self._nod).start()
        else:
            response.message = 'nodding already'
        return response

    def _nod(self):
        try:
            self.move_robot(0.0, 0.5, 0.5)
            self.move_robot(0.0, -0.5, 0.5)
        except ControlError as error:
            self.get_logger().error(str(error))
        finally:
            self._nodding.release()


def main():
    """Serve requests until Ctrl+C."""
    rclpy.init()
    rclpy.spin(NodOnRequest())


if __name__ == '__main__':
    main()
