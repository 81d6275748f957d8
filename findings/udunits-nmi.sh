#!/bin/sh
# SPDX-License-Identifier: MIT
# UDUNITS reads nmi, the usual symbol of the nautical mile, as a nano-mile, and kn, that of the knot, not at all.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch udunits-bin=2.2.28-5 libudunits2-0=2.2.28-5 libudunits2-data=2.2.28-5
export UDUNITS2_XML_PATH="$root/usr/share/xml/udunits/udunits2.xml"

in_metres() { udunits2 -H "$1" -W m | sed -n 's/.*1 [^ ]* = \([^ ]*\) m.*/\1 m/p'; }
seen "1 nautical_mile" "1852 m" "1852 m" "$(in_metres nautical_mile)"
seen "1 nmi" "1852 m" "1.60934e-06 m" "$(in_metres nmi)"
seen "kn" "a knot, as kt is" "udunits2: Don't recognize \"kn\"" "$(udunits2 -H kn -W m/s 2>&1 | head -1)"
