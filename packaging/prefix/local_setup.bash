AMENT_CURRENT_PREFIX="$(builtin cd -- "$(dirname -- "${BASH_SOURCE[0]}")" >/dev/null && pwd)"
. "$AMENT_CURRENT_PREFIX/local_setup.sh"
