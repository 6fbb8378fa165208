// What bindgen reads: the header of the Embree that is installed. The build script defines TWINCAST_EMBREE.
#if TWINCAST_EMBREE == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
