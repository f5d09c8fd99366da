# Lets ros2 run and ros2 launch find the packages of this prefix, wherever it lies: it goes to the front of AMENT_PREFIX_PATH.
# A POSIX shell does not tell a sourced file its place: AMENT_CURRENT_PREFIX=/its/place . /its/place/local_setup.sh
if [ -e "${AMENT_CURRENT_PREFIX:-}/share/laser_profiler/package.xml" ]; then
  case ":${AMENT_PREFIX_PATH:-}:" in
    *":$AMENT_CURRENT_PREFIX:"*) ;;
    *) export AMENT_PREFIX_PATH="$AMENT_CURRENT_PREFIX${AMENT_PREFIX_PATH:+:$AMENT_PREFIX_PATH}" ;;
  esac
  unset AMENT_CURRENT_PREFIX
else
  echo "laser_profiler: set AMENT_CURRENT_PREFIX to the directory of this file, or source local_setup.bash or .zsh" >&2
fi
