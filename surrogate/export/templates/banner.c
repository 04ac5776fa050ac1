/* Track-terrain forces of the $vehicle on $mode ground: see $name.h.
 *
 * SPDX-License-Identifier: MIT
 * The C core of grouser $version with the artifact $hash. */
#include "$name.h"

