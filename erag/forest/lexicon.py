"""Closed English word lists that the term extractor and the check of summaries rest on."""

from __future__ import annotations

from erag.core.text import word_set as _words

DETERMINERS = _words("a an the this that these those its their his her our your my each every any some another")
QUANTITIES = _words("""
    all both several few many much multiple numerous various more most less least other others different additional
    couple number variety series range set lot lots plenty handful pair group groups row rows part parts one two three
    four five six seven eight nine ten dozen dozens single double various varied varying
""")
AUXILIARIES = _words("""
    is are was were be been being am has have had having do does did can could may might must shall should will would
    there's it's i'm i've i'll i'd we're we've you're they're that's what's can't couldn't won't don't doesn't didn't
    sorry unable apologize apologise request assist assistance
""")
PREPOSITIONS = _words("""
    of in on at by with from to into onto near along alongside beside besides beneath under below above over across
    around through throughout between among amidst amid against behind beyond before after within inside outside
    toward towards during upon up down off out past via per for about opposite next adjacent like as until since
    underneath atop amongst
""")
JOINERS = _words("and or nor but though although however while whereas yet if because so than then plus")
PRONOUNS = _words("""
    it they them he she we us i you who whom which whose what where when why how itself themselves there here not no
    elsewhere average member members without neither also too very just only even still again further either same such
    once not
""")

NEGATORS = _words("""
    no without lacks lack lacking absence devoid neither nor never not lacked n't isn't aren't cannot can't couldn't
    don't doesn't
""")
SEEN = _words("visible present seen apparent evident noticeable shown observed found identifiable discernible depicted")
CLAUSE_BREAKS = _words("but though although however while whereas yet except which who where that because if so")

# How captions and summaries speak; none of these names a thing that could be seen or missed.
TALK = _words("""
    scene scenes image images picture photo photograph photos view views panorama panoramic perspective shot frame
    depict depicts depicted depicting show shows showing shown showcase showcases showcasing showcased feature features
    featuring featured display displays displayed displaying capture captures captured capturing present presents
    presenting presented portray portrays portraying reveal reveals contain contains containing contained include
    includes including included comprise comprises comprising consist consists consisting characterize characterizes
    characterized characterised characterizing defined describe describes described visible seen see observed notable
    noticeable apparent evident likely possibly perhaps appear appears appearing seem seems suggest suggests suggesting
    suggested indicate indicates indicating indicated indicative imply implies implying hint hints hinting reflect
    reflects reflecting convey conveys conveying evoke evokes evoking typical typically generally general overall mostly
    mainly primarily largely partly partially slightly relatively fairly clearly prominently specifically specific
    particular particularly
    environment environments setting settings atmosphere ambiance ambience backdrop background foreground surroundings
    surrounding middle center centre central left right side sides front back rear top bottom corner corners edge edges
    distance distant nearby far close further ahead end ends beginning direction directions location locations place
    places spot spots point points presence elements element detail details feel feeling sense touch mood character
    aspect aspects activity activities purpose purposes addition contrast contrasts combination mix mixture blend blends
    blending blended variety sort kind kinds type types way ways thing things item items object objects
    add adds adding added provide provides providing provided offer offers offering offered give gives giving given
    create creates creating created contribute contributes contributing enhance enhances enhancing enhanced allow allows
    allowing make makes making made emphasize emphasizes emphasizing highlight highlights highlighting highlighted bring
    brings bringing take takes taking use used using uses serve serves serving served stand stands standing stood sit
    sits sitting situated located positioned placed set lie lies lying run runs lead leads leading led extend extends
    extending stretch stretches stretching rise rises rising loom looms dominate dominates dominated dominating
    surround surrounds surrounded surrounding border borders bordered bordering flank flanks flanked flanking line lined
    lining accompany accompanied adorn adorned dot dotted scatter scattered fill filled populate populated intersperse
    interspersed connect connects connecting connected intersect intersects intersecting intersected adjoin adjoins
    adjoining separate separates separating separated divide divides divided dividing cover covers covered enclose
    encloses enclosed encircle encircles encircling frame frames framed framing overlook overlooks overlooking face
    faces facing read reads reading say says saying labeled labelled marked name named label labels text word words
    cast casts casting come comes coming go goes going look looks looking found find keep kept appear remain remains
    remaining form forms forming formed combine combines combining combined integrate integrates integrated integrating
    complement complements complementing support supports supported supporting accent accents accented
    noted worth additionally moreover furthermore finally furthermore together respectively mean means based
    filter filters filtering wind winds curve curves cut cuts crisscross crisscrosses winding nature focus access
    throughout possible approach approaches sit rest parallel welcome welcomes
    clear readable legible unreadable discernible identifiable view available
""")

# Verbs of summaries: what connects things, and what things are said to do for people.
VERBS = _words("""
    accentuate accommodate accompany accentuates advertise advertises align aligns alternate alternates bear bearing
    beautify boast boasts bound breaks bring brings build built bustle carry carries change changes coexist coexists
    commemorate complement complements control controls converge converges cross crosses define defines delineate
    demarcate denote denotes describe direct directs dominate draw draws ease emerge enable enables encourage encourages
    enrich enriches ensure ensures establish establishes exhibit exhibits facilitate facilitates flow flows follow
    follows foster fosters frequent function functions gather gathers guard guards guide guides handle handles hang
    hangs help helps hide hold holds host hosts identify identifies illuminate illuminates impact impacts improve
    improves influence influences inform informs interact interacts interconnect interconnects interweave intermingle
    invite invites join joins leave lend lends light lights link links live maintain maintains manage manages mark marks
    meander meanders meet meets merge merges mirror mirrors mix move moves navigate navigates obscure obscures occupy
    occupies occur occurs outline outlines overhang pave pass passes permit pierce promote promotes protect protects
    punctuate punctuates regulate regulates represent represents require requires reside rest retain retains rest secure
    separate shade shades shape shapes share shares shield shields signal signals signify signifies slope slopes soften
    softens span spans split splits stay step suit supply symbolize symbolizes tower towers transform transforms
    transition transitions traverse traverses turn turns unify unite unites vary varies visit weave weaves welcome
    widen wrap work works
""") - _words("light lights mark control supply tower towers step shade flow slope turn bound")

# Nouns that say something only together with the words before them: `grassy area`, `parking space`.
LIGHT = _words("""
    area areas space spaces zone zones section sections region regions structure structures style styles design designs
    system surface level levels site site's spread expanse stretch patch patches piece unit units field's lot lots line
    lines side material materials color colors shape shapes pattern patterns option options
    condition conditions day days time times season seasons year years
    hour hours light shade shades tone tones hue hues appearance backdrop display equipment feature facility facilities
""")

# What a summary may say without any member having said it: evaluation, abstraction and the verbs of relations.
NEUTRAL = _words("""
    serene tranquil peaceful calm quiet vibrant lively bustling picturesque scenic charming inviting welcoming pleasant
    cozy cosy comfortable beautiful beauty lovely attractive harmonious idyllic relaxing relaxed restful busy active
    dynamic diverse eclectic distinct distinctive unique notable prominent significant ideal suitable perfect popular
    accessible organized organised orderly functional practical convenient essential common typical mixed varied similar
    main major key important overall visual natural nature living daily everyday typical traditional
    connectivity transition transitional transitioning transitions interplay juxtaposition coexist coexists coexisting
    coexistence integration balance balanced emphasis focus focal hub vibe charm appeal aesthetic aesthetics essence
    experience scenery landscape landscapes landscaping surroundings neighbourhood network
    infrastructure architecture architectural development developments zone zones region regions sector vicinity
    locale district complex community communities
    feature parallel parallels adjacent bisect bisects traverse traverses cross crosses weave weaves wind winds
    meander meanders meet meets merge merges converge converges link links linking linked join joins joined abut abuts
    span spans near situated host hosts house houses housing accommodate accommodates facilitate facilitates regulate
    regulates encourage encourages ensure ensures promote promotes fosters foster seamlessly interconnected
    interwoven intertwined intermingled alternate alternating change changes changing
    element popular various primarily visitors residents people individuals individual
    members member part entire whole often frequent occasional occasionally prevalent abundant rich extensive built
    accessibility relaxation transport transportation information visibility identity safety movement interaction
    interactions guidance navigation mobility functionality prominence affiliation variation variations change changes
    influence diversity proximity boundary boundaries landmark landmarks attraction attractions venue venues collection
    connection connections flow theme themes interest lifestyle culture cultural social leisure recreation privacy
    comfort convenience environment comprehensive combination convergence contrast opportunity opportunities
    seasonal characteristic characteristics event events streetscape streetscapes cityscape cityscapes
    greenway layout scenario
    area areas space spaces structure structures style styles design designs section sections level levels material
    materials color colors pattern patterns option options condition conditions day days time times season seasons
    year years appearance facility facilities amenity amenities
    designed dedicated intended
""")
ABSTRACT_ENDINGS = ("ity", "ness", "tion", "sion", "ance", "ence", "ism", "ship", "ful", "ive", "ously", "ly")

SEASONS = {
    "autumn": "autumn", "fall": "autumn", "autumnal": "autumn", "winter": "winter", "wintry": "winter",
    "wintertime": "winter", "spring": "spring", "springtime": "spring", "summer": "summer", "summertime": "summer",
}  # fmt: skip
WEATHER = _words("""
    overcast sunny cloudy rainy snowy foggy misty clear-sky rain snow fog sunlight sunshine sky cloud dusk dawn night
    nighttime daytime evening morning twilight gloomy bright
""")
ATTRIBUTES = _words("""
    red green blue yellow orange brown black white gray beige pink purple silver golden tan maroon cream dark light
    large small tall wide narrow long short big huge low high spacious expansive broad compact massive
    modern contemporary classical classic historic historical traditional old older new neoclassical gothic victorian
    brick stone concrete glass wooden wood metal metallic steel marble asphalt granite gravel brass iron leather plastic
    urban suburban rural residential commercial academic institutional industrial collegiate educational recreational
    public private indoor outdoor natural
    paved grassy leafless bare lush mature vibrant colorful manicured well-maintained well-kept well-manicured
    architectural overhead ample open sport similar running autumn winter spring summer
    landscaped shaded deciduous evergreen dense sparse curved arched circular rectangular multi-story two-story
    three-story tree-lined polished reflective minimalist sleek
    left-hand quiet serene calm peaceful tranquil lively bustling busy cozy clean ornate decorative prominent
""")
ADJECTIVE_ENDINGS = ("al", "ous", "ful", "less", "ive", "ic", "ed", "ish", "like", "ate", "est", "ern", "y")
PLACES = _words("""
    park street road avenue alley alleyway intersection crosswalk crossing sidewalk path pathway walkway trail lane
    highway bridge overpass underpass tunnel driveway roadway parking-lot lot garage campus university college school
    courtyard plaza square quad lawn field court stadium track playground garden yard patio terrace deck pond lake river
    hill slope neighborhood district suburb city town downtown building house home church chapel museum library hall
    restaurant cafe shop store hospital office room corridor hallway lobby lounge kitchen bathroom cafeteria auditorium
    classroom laboratory workshop gallery entrance exit staircase stairwell stair elevator escalator tower station
    shelter interior conservatory cemetery area space zone facility mall atrium foyer workspace canteen dormitory
    gate market forest woodland meadow beach harbour harbor dock warehouse basement roof balcony
""")

IRREGULAR = {
    "people": "person", "men": "man", "women": "woman", "children": "child", "leaves": "leaf", "shelves": "shelf",
    "feet": "foot", "teeth": "tooth", "geese": "goose", "mice": "mouse", "knives": "knife", "lives": "life",
    "wolves": "wolf", "loaves": "loaf", "halves": "half", "buses": "bus", "axes": "axis", "stories": "story",
    "movies": "movie", "cookies": "cookie", "scarves": "scarf",
}  # fmt: skip
UNCOUNTED = _words("""
    campus grass glass bus canvas gas lens news moss cross access address business class compass cypress dress
    fortress glasses harness mattress press process success walrus abacus cactus octopus bonus focus series species
    columbus chess moss boss fitness wilderness across always perhaps arts pass is was its this as us has
    octopus apparatus status mess bass brass iris basis tennis trellis ibis oasis debris chassis bias atlas
""")
SYNONYMS = {
    "grey": "gray", "colour": "color", "coloured": "colored", "colourful": "colorful", "bike": "bicycle",
    "centre": "center", "automobile": "car", "neighbourhood": "neighborhood",
    "multi-storey": "multi-story", "multistory": "multi-story", "storey": "story", "façade": "facade", "café": "cafe",
    "lamp-post": "lamppost", "roadway": "road", "roadside": "road",
    "harbour": "harbor", "theatre": "theater", "parkland": "park", "cross-walk": "crosswalk",
}  # fmt: skip
# A word of a summary on the left is borne out by any of the words on the right.
BROADER = {
    "vehicle": "car truck van bus suv sedan pickup motorcycle", "pedestrian": "person student woman man visitor child",
    "person": "student pedestrian man woman individual visitor child cyclist", "student": "pedestrian person",
    "greenery": "tree shrub grass bush lawn plant foliage hedge", "vegetation": "tree shrub grass bush plant foliage",
    "plant": "tree shrub bush flower hedge", "pathway": "path walkway sidewalk trail", "path": "pathway walkway trail",
    "walkway": "path pathway sidewalk", "street": "road avenue", "road": "street avenue lane driveway",
    "furniture": "chair table sofa desk bench couch cabinet", "seating": "chair bench sofa seat couch stool",
    "foliage": "leaf tree", "building": "house hall church tower library museum", "tree": "foliage oak maple",
    "lawn": "grass grassy", "grass": "lawn grassy turf", "grassy": "grass lawn",
    "snowy": "snow", "leafy": "leaf foliage", "wooded": "tree forest", "signage": "sign",
    "lighting": "lamp light lamppost",
    "residence": "house home residential", "home": "house residential", "house": "home residential",
    "landscaped": "manicured well-maintained", "historic": "historical", "historical": "historic",
    "color": "colored colorful orange red yellow", "suburban": "residential", "university": "campus college academic",
    "campus": "university college academic", "academic": "university campus college educational",
    "educational": "university campus college academic school", "athletic": "sport", "sport": "athletic",
    "sky": "overcast cloudy cloud", "weather": "overcast cloudy sunny rain", "chair": "seat seating",
    "screen": "tv monitor",
}  # fmt: skip

# How one thing stands to the next: the word met -> (how it is said, whether the two change places).
RELATIONS = {
    "along": ("along", False), "alongside": ("along", False), "beside": ("beside", False), "next": ("beside", False),
    "adjacent": ("beside", False), "near": ("near", False), "behind": ("behind", False), "under": ("under", False),
    "beneath": ("under", False), "across": ("across", False), "around": ("around", False), "on": ("on", False),
    "through": ("through", False), "overlooking": ("overlooking", False), "leading": ("leading to", False),
    "lined": ("lined with", False), "lining": ("lined with", True), "line": ("lined with", True),
    "surrounded": ("surrounded by", False), "surrounding": ("surrounded by", True),
    "bordered": ("bordered by", False), "bordering": ("bordered by", True), "flanked": ("flanked by", False),
    "flanking": ("flanked by", True), "enclosed": ("enclosed by", False), "covered": ("covered with", False),
}  # fmt: skip
NEARLY = {
    **dict.fromkeys(("along", "beside", "near", "on", "through"), "by"),
    **dict.fromkeys(("lined with", "flanked by", "bordered by", "surrounded by", "enclosed by"), "framed by"),
}  # relations that a summary may put for one another
NOUNS_IN_ING = _words("""
    building railing crossing lighting seating ceiling landscaping marking opening clearing painting parking paving
    awning siding fencing housing wiring flooring covering carving cladding glazing string spring wing ring evening
    morning king thing planting plantings lettering opening drawing recycling
""")
NOUNS_IN_ED = _words("bed shed seed red reed feed weed speed moped")
ADJECTIVES_IN_LY = _words("family friendly early lovely supply lively only curly daily orderly")
