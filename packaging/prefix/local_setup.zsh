AMENT_CURRENT_PREFIX="${${(%):-%x}:A:h}"
. "$AMENT_CURRENT_PREFIX/local_setup.sh"
