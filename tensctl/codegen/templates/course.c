/* Sample of the course that many periods ahead; after its last one the course rests. */
static int ahead(int periods)
{
    return self.sample + periods < COURSE ? self.sample + periods : COURSE - 1;
}
